"""The part of a calibration's report that shows the sampled posterior."""

from edtk.calibration.pose_error import PoseError
from edtk.calibration.posterior_check import PosteriorCheck
from edtk.report.digits import digits
from edtk.report.page import heading, paragraph, picture, table
from edtk.report.posterior_figures import corner, residuals, trace


def posterior_report(check: PosteriorCheck) -> str:
    """A table, what it means in the test pose, and the pictures."""
    parts = [heading("What does the posterior say?"), paragraph(_chain(check)), _compliances(check)]
    if check.ratio_to_expect != 1:
        parts.append(
            paragraph(
                f"As sigma was estimated, a ratio of {check.ratio_to_expect:.3f} is to be expected."
            )
        )
    for name, (median, low, high) in check.noise_intervals.items():
        parts.append(
            paragraph(f"{_NOISE[name]}: {median:.3g}, between {low:.3g} and {high:.3g} (95 %).")
        )
    if check.pose is not None:
        parts.append(paragraph(_test_pose(check.pose)))
    parts.append(
        picture(corner(check), "The sampled posterior: each compliance, and each pair of them.")
    )
    parts.append(
        picture(residuals(check), "Posterior-predictive residuals, in units of the stated noise.")
    )
    parts.append(
        picture(trace(check), "The chain after burn-in: it should look like noise, without drift.")
    )
    return "\n".join(parts)


_NOISE = {"sigma_ratio": "Noise over the stated one", "nu": "Degrees of freedom of Student's t"}


def _chain(check: PosteriorCheck) -> str:
    """How far the numbers below can be trusted."""
    least, r_hat = check.table["effective_samples"].min(), check.table["r_hat"].max()
    return (
        f"{check.posterior.samples.shape[1]} walkers made {check.posterior.steps} steps; the chain has converged: "
        f"at least {least:.0f} effective samples for each compliance, split-chain R-hat at most {r_hat:.4f}."
    )


def _compliances(check: PosteriorCheck) -> str:
    """One row a parameter."""
    columns = check.table.set_index("parameter").drop(columns="unit")
    rows = []
    for name, unit, row in zip(
        columns.index, check.table["unit"], columns.to_numpy(dtype=float), strict=True
    ):
        of = dict(zip(columns, row.tolist(), strict=True))
        std = of["std_posterior"]
        ratio = f"{of['ratio']:.3f} \u00b1 {of['ratio_error']:.3f}"
        interval = f"{digits(of['low_95'], std)} .. {digits(of['high_95'], std)}"
        fit = f"{of[check.compared[0]]:.2e}"
        rows.append([name, unit, digits(of["mean"], std), f"{std:.2e}", fit, ratio, interval])
    return table(
        ["parameter", "unit", "mean", "std", check.compared[1], "ratio", "95 % interval"], rows
    )


def _test_pose(pose: PoseError) -> str:
    """Error and displacement in the test pose [mm]."""
    low, high = 1e3 * pose.displacement_95
    axes = ", ".join(f"{n} {a:.4f} to {b:.4f}" for n, a, b in zip("xyz", low, high, strict=True))
    return (
        f"In the test pose the error after compensation is {1e3 * pose.rho0:.3g} mm (root mean square; "
        f"{1e3 * pose.rho0_fit:.3g} mm by the fit, Eq. (20)), and with 95 % probability below "
        f"{1e3 * pose.error_95:.3g} mm. Displacement under the task's load, 95 % intervals in mm: {axes}."
    )
