"""A normal quantile plot of residuals."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.inference.identification import Identification
from edtk.report.palette import BLUE

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def quantiles(fit: Identification, ax: "Axes") -> None:
    """Draw standardised residuals against normal quantiles."""
    from scipy.stats import probplot

    z = fit.standardised[np.isfinite(fit.standardised)]
    if len(z) > 1:
        expected, seen = probplot(z, fit=False)
        ax.plot(expected, seen, linestyle="", marker="o", markersize=3, color=BLUE)
        ends = np.array([min(expected), max(expected)])
        ax.plot(ends, ends, color="black", linewidth=1, linestyle="--")
    ax.set(xlabel="normal quantile", ylabel="standardised residual")
    ax.grid(alpha=0.3)
