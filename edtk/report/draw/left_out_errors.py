"""How far off each pose is if it is predicted without having been fitted."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.inference.geometry.geometric_fit import MM, GeometricFit
from edtk.report.draw.thinned import thinned
from edtk.report.palette import COLOURS, MARKERS

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def left_out_errors(fit: GeometricFit, ax: "Axes") -> None:
    """Draw the distance of each marker from where the other poses predict it [mm]."""
    distance = MM * np.linalg.norm(fit.left_out, axis=-1)
    for i, name in enumerate(fit.data.markers):
        seen = np.flatnonzero(np.isfinite(distance[:, i]))
        shown = seen[thinned(distance[seen, i])]
        ax.plot(
            shown + 1,
            distance[shown, i],
            linestyle="",
            marker=MARKERS[i % len(MARKERS)],
            markersize=4,
            color=COLOURS[i % len(COLOURS)],
            label=name,
        )
    rms = MM * fit.loo_rms
    ax.axhline(rms, color="grey", linestyle="--", linewidth=1, label="rms")
    ax.set(xlabel="pose", ylabel="distance [mm]")
    ax.set_ylim(bottom=0)
    ax.locator_params(axis="x", integer=True)
    ax.grid(alpha=0.3)
    ax.legend(ncols=4, fontsize=9, frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0))
