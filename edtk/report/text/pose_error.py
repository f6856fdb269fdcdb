"""Text of the errors in the test pose."""

from edtk.calibration.pose_error import PoseError


def pose_error(error: PoseError) -> str:
    """Error after compensation, and displacement under the task's load [mm]."""
    low, high = 1e3 * error.displacement_95
    axes = ", ".join(f"{n} {a:.4f} to {b:.4f}" for n, a, b in zip("xyz", low, high, strict=True))
    place = error.place.removeprefix("in the ").removeprefix("in ")
    which = "" if error.displaced is None else f" in pose {error.displaced}"
    return (
        f"{place}: rho0 {1e3 * error.rho0:.6f} +- {1e3 * error.rho0_error:.6f} mm, "
        f"by the fit, Eq. (20), {1e3 * error.rho0_fit:.6f} mm\n"
        f"error after compensation below {1e3 * error.error_95:.6f} mm with probability 95 %\n"
        f"displacement under the task's load{which}, 95 % intervals [mm]: {axes}"
    )
