"""Residuals of a fit, measurement by measurement."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from edtk.inference.identification import Identification
from edtk.report.palette import COLOURS, ORANGE
from edtk.system.typing import Indices
from edtk.tables.coordinate_columns import coordinate_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARKERS = "osD"
MOST = 4000  # measurements that are drawn evenly, and as many of the largest residuals
UNITS = ((1e3, "mm"), (180 / np.pi, "deg"))


def residuals(fit: Identification, axes: "Iterable[Axes]") -> None:
    """Draw residuals of positions [mm] and, where they are measured, of rotations [deg].

    Args:
        fit: The fit.
        axes: One for the positions, and one more where rotations are measured.
    """
    worst = np.abs(fit.standardised).argmax(axis=1)
    for part, (ax, (factor, unit)) in enumerate(zip(axes, UNITS, strict=False)):
        chosen = slice(3 * part, 3 * part + 3)
        residual = factor * fit.residual[:, chosen]
        _coordinates(residual, fit.standardised[:, chosen], ax)
        flagged = fit.outliers[worst[fit.outliers] // 3 == part]
        if len(flagged):
            _circles(flagged, residual[flagged, worst[flagged] - 3 * part], ax)
        ax.set_ylabel(f"{'rotation ' * part}residual [{unit}]")
        ax.grid(alpha=0.3)
        ax.legend(ncols=4, fontsize=9, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    ax.set_xlabel("measurement (row of the file)")


def drawn_rows(residual: np.ndarray) -> Indices:
    """Rows of residuals (m, 3) that are drawn: all, or of many some and those that fit least."""
    m = len(residual)
    if m <= 2 * MOST:
        return np.arange(m)
    least = np.argpartition(-np.abs(residual).max(axis=1), MOST)[:MOST]
    return np.union1d(np.linspace(0, m - 1, MOST).astype(int), least)


def _coordinates(residual: np.ndarray, standardised: np.ndarray, ax: "Axes") -> None:
    """Three coordinates, or a distance, over a band of twice the noise."""
    shown = drawn_rows(residual)
    for j, name in enumerate(coordinate_names(residual.shape[1])):
        ax.plot(
            shown + 1,
            residual[shown, j],
            linestyle="",
            marker=MARKERS[j],
            markersize=4,
            color=COLOURS[j],
            label=name,
        )
    noise = np.median(np.abs(residual / np.where(standardised == 0, 1, standardised)))
    band = 2 * float(noise)
    ax.axhspan(-band, band, color="grey", alpha=0.15, linewidth=0)


def _circles(rows: np.ndarray, residual: np.ndarray, ax: "Axes") -> None:
    """Outliers in circles."""
    ax.plot(
        rows + 1,
        residual,
        linestyle="",
        marker="o",
        markersize=12,
        fillstyle="none",
        color=ORANGE,
        label="outlier",
    )
