"""Residuals of the markers of a geometry, pose by pose."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.inference.geometry.geometric_fit import MM, GeometricFit
from edtk.report.draw.thinned import thinned
from edtk.report.palette import COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARKERS = "osD"


def marker_residuals(fit: GeometricFit, marker: int, ax: "Axes") -> None:
    """Draw the residuals of one marker [mm], over a band of twice their usual size.

    Args:
        fit: The fit.
        marker: Its index.
        ax: Where to draw.
    """
    residual = MM * fit.residual[:, marker]
    seen = np.flatnonzero(np.isfinite(residual).all(axis=1))
    shown = seen[thinned(np.abs(residual[seen]).max(axis=1))]
    for axis in range(3):
        ax.plot(
            shown + 1,
            residual[shown, axis],
            linestyle="",
            marker=MARKERS[axis],
            markersize=4,
            color=COLOURS[axis],
            label="xyz"[axis],
        )
    band = 2 * 1.4826 * float(np.median(np.abs(residual[seen]))) if len(seen) else 0.0
    ax.axhspan(-band, band, color="grey", alpha=0.15, linewidth=0)
    ax.set(xlabel="pose", ylabel="residual [mm]")
    ax.set_title(f"marker {fit.data.markers[marker]}", fontsize=10, loc="left")
    ax.locator_params(axis="x", integer=True)
    ax.grid(alpha=0.3)
    ax.legend(ncols=3, fontsize=9, frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0))
