"""Sampled posteriors beside what the fit states."""

from typing import Any

from edtk.calibration.posterior_check import PosteriorCheck
from edtk.fit.posterior import Posterior
from edtk.report.draw.posterior import LabelledSamples, corner
from edtk.report.figures import panels
from edtk.report.shown import SMALL, places_of, with_digits
from edtk.report.tables import name_width, notebook_table


def posterior_text(found: Posterior) -> str:
    """The headline, and a row a parameter with its 95 % interval."""
    table = found.to_frame().to_string(index=False, float_format="{:.4g}".format)
    return f"{found.headline()}\n{table}"


def posterior_check_text(check: PosteriorCheck) -> str:
    """Standard deviations beside those of the fit, intervals, noise, and the test pose."""
    column, label = check.compared
    width = name_width(check.table["parameter"], 8)
    units = check.table["unit"].unique()
    lines = [
        check.posterior.quality,
        f"{'param':{width}}{'std posterior':>14}{label:>17}{'ratio':>9}{'+- (MC)':>9}"
        f"{'95 % interval':>26}{'effective samples':>19}{'  unit' * (len(units) > 1)}",
    ]
    table = check.table
    for row, std in zip(table.itertuples(), table["std_posterior"].tolist(), strict=True):
        form = f".{places_of(std)}f" if std >= SMALL else ".4e"
        interval = f"{row.low_95:{form}} to {row.high_95:{form}}"
        lines.append(
            f"{row.parameter:{width}}{std:14.5g}{getattr(row, column):17.5g}"
            f"{row.ratio:9.4f}{row.ratio_error:9.4f}"
            f"{interval:>26}{row.effective_samples:19.0f}{f'  {row.unit}' * (len(units) > 1)}"
        )
    if len(units) == 1:
        lines.append(f"standard deviations and intervals in {units[0]}")
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


def posterior_check_notebook(check: PosteriorCheck) -> str:
    """A row for each parameter, and the test pose."""
    column, label = check.compared
    rows = []
    for row in check.table.to_dict(orient="records"):
        std = row["std_posterior"]
        mean = with_digits(row["mean"], std)
        ratio = f"{row['ratio']:.3f} \u00b1 {row['ratio_error']:.3f}"
        cells = [row["parameter"], mean, f"{std:.2e}", f"{row[column]:.2e}", ratio, row["unit"]]
        rows.append(cells)
    notes = [] if check.pose is None else [check.pose.headline()]
    header = ["parameter", "mean", "std", label, "ratio", "unit"]
    return notebook_table(check.headline(), header, rows, notes)


def posterior_check_plot(check: PosteriorCheck, ax: Any = None) -> Any:
    """Draw each parameter, and each pair of them; lines are at the reference.

    Returns:
        The axes (d, d); those above the diagonal are empty.
    """
    shown = LabelledSamples.of(check)
    d = len(shown.labels)
    axes = panels(ax, d, d, (1.6 + 1.55 * d, 1.6 + 1.55 * d), sharex="col")
    corner(shown, axes)
    if ax is None:
        title = f"Posterior, with contours that hold 39 % and 86 %; lines: {check.reference}"
        axes[0, 0].figure.suptitle(title, fontsize=11)
    return axes
