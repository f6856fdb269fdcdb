"""Text of a posterior check."""

from edtk.calibration.posterior_check import PosteriorCheck
from edtk.report.text_table import name_width


def posterior_check(check: PosteriorCheck) -> str:
    """Standard deviations beside those of the fit, intervals, noise, and the test pose."""
    column, label = check.compared
    width = name_width(check.table["parameter"], 8)
    lines = [
        f"{'param':{width}}{'std posterior':>14}{label:>17}{'ratio':>9}{'+- (MC)':>9}"
        f"{'95 % interval':>26}{'effective samples':>19}"
    ]
    for row in check.table.itertuples():
        interval = f"{row.low_95:.4e} to {row.high_95:.4e}"
        lines.append(
            f"{row.parameter:{width}}{row.std_posterior:14.5g}{getattr(row, column):17.5g}"
            f"{row.ratio:9.4f}{row.ratio_error:9.4f}"
            f"{interval:>26}{row.effective_samples:19.0f}"
        )
    units = " or ".join(check.table["unit"].unique())
    lines.append(f"standard deviations and intervals in {units}")
    if check.rest:
        lines.append(check.rest)
    if check.ratio_to_expect != 1:
        ratio = f"{check.ratio_to_expect:.4f}"
        lines.append(f"as sigma was estimated, a ratio of {ratio} is to be expected")
    for name, (median, low, high) in check.noise_intervals.items():
        lines.append(f"{name}: {median:.4g}, 95 % interval {low:.4g} to {high:.4g}")
    if check.pose is not None:
        lines.append(check.pose.summary())
    return "\n".join(lines)
