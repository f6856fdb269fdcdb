"""The part of a calibration's report that shows the sampled posterior."""

from edtk.calibration.pose_error import PoseError
from edtk.calibration.posterior_check import PosteriorCheck
from edtk.report.digits import digits
from edtk.report.page import paragraph, picture, section, table
from edtk.report.posterior_figures import posterior_figures

NOISE = {"sigma_ratio": "Noise over the stated one", "nu": "Degrees of freedom of Student's t"}


def posterior_report(check: PosteriorCheck) -> str:
    """A table, its meaning in the test pose, and the pictures."""
    parts = [paragraph(_chain(check)), _compliances(check)]
    if check.rest:
        parts.append(paragraph(f"{check.rest[:1].upper()}{check.rest[1:]}."))
    if check.ratio_to_expect != 1:
        ratio = f"{check.ratio_to_expect:.3f}"
        parts.append(paragraph(f"As sigma was estimated, a ratio of {ratio} is to be expected."))
    for name, (median, low, high) in check.noise_intervals.items():
        text = f"{NOISE[name]}: {median:.3g}, between {low:.3g} and {high:.3g} (95 %)."
        parts.append(paragraph(text))
    if check.pose is not None:
        parts.append(paragraph(_test_pose(check.pose)))
    figures = posterior_figures(check)
    pictures = (
        (figures.corner, "The sampled posterior: each compliance, and each pair of them."),
        (figures.residuals, "Posterior-predictive residuals, in units of the stated noise."),
        (figures.trace, "The chain after burn-in: it should look like noise, without drift."),
    )
    parts += [picture(figure, caption) for figure, caption in pictures]
    return section("What does the posterior say?", *parts)


def _chain(check: PosteriorCheck) -> str:
    """How far the numbers below can be trusted."""
    walkers = check.posterior.samples.shape[1]
    least = check.table["effective_samples"].min()
    r_hat = check.table["r_hat"].max()
    return (
        f"{walkers} walkers made {check.posterior.steps} steps; the chain has converged: at least "
        f"{least:.0f} effective samples for each compliance, split-chain R-hat at most {r_hat:.4f}."
    )


def _compliances(check: PosteriorCheck) -> str:
    """A table with a row for each parameter."""
    column, label = check.compared
    rows = []
    for record in check.table.to_dict(orient="records"):
        std = record["std_posterior"]
        rows.append(
            [
                record["parameter"],
                record["unit"],
                digits(record["mean"], std),
                f"{std:.2e}",
                f"{record[column]:.2e}",
                f"{record['ratio']:.3f} \u00b1 {record['ratio_error']:.3f}",
                f"{digits(record['low_95'], std)} .. {digits(record['high_95'], std)}",
            ]
        )
    return table(
        ["parameter", "unit", "mean", "std", label, "ratio", "95 % interval"], rows, full=True
    )


def _test_pose(pose: PoseError) -> str:
    """Error and displacement in the test pose [mm]."""
    low, high = 1e3 * pose.displacement_95
    axes = ", ".join(f"{n} {a:.4f} to {b:.4f}" for n, a, b in zip("xyz", low, high, strict=True))
    place = f"{pose.place[:1].upper()}{pose.place[1:]}"
    which = "" if pose.displaced is None else f" in pose {pose.displaced}"
    return (
        f"{place} the error after compensation is {1e3 * pose.rho0:.3g} mm (root mean "
        f"square; {1e3 * pose.rho0_fit:.3g} mm by the fit, Eq. (20)), and with 95 % probability "
        f"below {1e3 * pose.error_95:.3g} mm. Displacement under the task's load{which}, 95 % "
        f"intervals in mm: {axes}."
    )
