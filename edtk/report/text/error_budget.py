"""Text of an error budget."""

from edtk.model.error_budget import ErrorBudget

# What the parts leave out where displacements are counted from the rigid robot.
NOT_IN_IT = "errors of the robot's geometry, and of its place in the measuring frame"


def error_budget(found: ErrorBudget) -> str:
    """The expected error in the task, with its parts."""
    parts = ", ".join(
        f"{name.replace('_', ' ')} {1e3 * part:.2g}" for name, part in found.parts.items()
    )
    without = f"  not in it: {NOT_IN_IT}\n" if found.absolute else ""
    return (
        f"total expected error {1e3 * found.total:.2g} mm (root mean square), "
        f"{1e3 * found.uncompensated:.2g} mm without compensation\n"
        f"  of it [mm]: {parts}\n{without}"
        f"  to improve first: {ADVICE[found.largest]}"
    )


# What makes each part smaller.
ADVICE = {
    "noise": "measure more experiments, or with less noise",
    "model": "fit the loaded equilibrium",
    "load": "weigh the load, and measure its direction",
    "tool": "measure where the tool point and the marker are",
    "rigid_joints": "identify the joints that count as rigid too, or bound their compliances",
    "drift": "measure unloaded and loaded readings shortly after each other",
    "repeatability": "repeat the measurements",
}
