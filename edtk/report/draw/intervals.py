"""Confidence intervals of identified compliances."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.inference.identification import Identification
from edtk.report.draw.name_ticks import name_ticks
from edtk.report.palette import BLUE

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def intervals(fit: Identification, parameters: tuple[str, ...], ax: "Axes") -> None:
    """Draw 95 % intervals of the compliances, relative to the estimates [%]."""
    # A compliance that was set to zero has no relative interval: its deviation is the unit then.
    scale = np.where(fit.k > 0, fit.k, fit.std)
    half = 100 * fit.half_interval / scale
    at = np.arange(len(fit.k))
    ax.errorbar(np.zeros(len(at)), at, xerr=half, fmt="o", color=BLUE, capsize=4)
    name_ticks(ax, y=parameters)
    ax.set_ylim(len(at) - 0.5, -0.5)
    ax.set_xlabel("deviation from the estimate [%]")
    ax.grid(axis="x", alpha=0.3)
