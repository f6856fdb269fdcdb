"""A normal quantile plot of residuals."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.inference.identification import Identification
from edtk.report.palette import BLUE
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TAIL = 1000  # of many points, so many at each end are drawn,
MIDDLE = 4000  # and so many of those between them, which hide each other


def quantiles(fit: Identification, ax: "Axes") -> None:
    """Draw standardised residuals against normal quantiles."""
    from scipy.special import ndtri

    z = np.sort(fit.standardised[np.isfinite(fit.standardised)])
    if len(z) > 1:
        some = _some(len(z))
        expected = ndtri(_order_medians(some, len(z)))
        ax.plot(expected, z[some], linestyle="", marker="o", markersize=3, color=BLUE)
        ends = expected[[0, -1]]
        ax.plot(ends, ends, color="black", linewidth=1, linestyle="--")
    ax.set(xlabel="normal quantile", ylabel="standardised residual")
    ax.grid(alpha=0.3)


def _order_medians(index: Indices, count: int) -> Array:
    """Medians of the order statistics of uniform numbers, by Filliben (1975)."""
    ends = 0.5 ** (1 / count)
    medians = (index + 1 - 0.3175) / (count + 0.365)
    return np.where(index == 0, 1 - ends, np.where(index == count - 1, ends, medians))


def _some(count: int) -> Indices:
    """Numbers of the points that are drawn."""
    if count <= 2 * TAIL + MIDDLE:
        return np.arange(count)
    middle = np.linspace(TAIL, count - 1 - TAIL, MIDDLE).astype(int)
    return np.concatenate([np.arange(TAIL), middle, np.arange(count - TAIL, count)])
