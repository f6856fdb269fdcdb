"""Confidence intervals of identified compliances."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.inference.identification import Identification
from edtk.report.draw.name_ticks import name_ticks
from edtk.report.palette import BLUE

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def intervals(
    fit: Identification, parameters: tuple[str, ...], units: tuple[str, ...], ax: "Axes"
) -> None:
    """Draw the 95 % intervals of `Identification.interval`, relative to the estimates [%].

    An interval that reaches to zero is as wide as its estimate, and would leave no room for the
    others: it is written out, in the parameter's unit.

    Args:
        fit: The fit.
        parameters: Names (p,).
        units: Units (p,) of the parameters.
        ax: Where to draw.
    """
    low, high = fit.interval
    at = np.arange(len(fit.k))
    known = (low > 0) & (fit.k > 0)
    scale = 100 / fit.k[known]
    middle = scale * (high - low)[known] / 2
    centre = scale * (high + low)[known] / 2 - 100
    ax.errorbar(centre, at[known], xerr=middle, fmt="none", color=BLUE, capsize=4)
    ax.plot(np.zeros(known.sum()), at[known], linestyle="", marker="o", color=BLUE)
    across = ax.get_yaxis_transform()
    for i in at[~known]:
        text = f"0 to {high[i]:.2g} {units[i]}"
        ax.axhspan(i - 0.4, i + 0.4, color="grey", alpha=0.15, linewidth=0)
        ax.text(0.5, i, text, transform=across, ha="center", va="center", fontsize=9)
    if not known.any():
        ax.set_xlim(-100, 100)
    name_ticks(ax, y=parameters)
    ax.set_ylim(len(at) - 0.5, -0.5)
    ax.set_xlabel("deviation from the estimate [%]")
    ax.grid(axis="x", alpha=0.3)
