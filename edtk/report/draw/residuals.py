"""Residuals of a fit, measurement by measurement."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from edtk.inference.identification import Identification
from edtk.report.palette import COLOURS, ORANGE
from edtk.system.typing import Indices, Mask
from edtk.tables.coordinate_columns import coordinate_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARKERS = "osD"
MOST = 4000  # measurements that are drawn evenly, and as many of the largest residuals
UNITS = ((1e3, "mm"), (180 / np.pi, "deg"))


@dataclass(frozen=True, eq=False)
class ResidualPanel:
    """What one panel shows.

    Attributes:
        rows: Measurements (k,), counted from 0.
        columns: Their coordinates.
        names: What these are called.
        turns: Whether they are rotations.
    """

    rows: Indices
    columns: slice
    names: tuple[str, ...]
    turns: bool

    @classmethod
    def of(cls, fit: Identification, turn: Mask | None = None) -> "tuple[ResidualPanel, ...]":
        """Positions and rotations apart.

        Args:
            fit: The fit.
            turn: Whether each measurement (m,) is a single rotation; None where none is.
        """
        m, count = fit.residual.shape
        every = np.arange(m)
        names = coordinate_names(count)
        if turn is None:
            parts = (slice(first, first + 3) for first in range(0, count, 3))
            return tuple(cls(every, part, names[part], part.start > 0) for part in parts)
        kinds = ((every[~turn], names, False), (every[turn], ("rotation",), True))
        return tuple(
            cls(rows, slice(0, 1), called, turns) for rows, called, turns in kinds if len(rows)
        )


def residuals(fit: Identification, axes: "Iterable[Axes]", parts: Iterable[ResidualPanel]) -> None:
    """Draw residuals of positions [mm] and, where they are measured, of rotations [deg].

    Args:
        fit: The fit.
        axes: One for each part.
        parts: What each shows.
    """
    worst = np.abs(fit.standardised).argmax(axis=1)
    for ax, part in zip(axes, parts, strict=True):
        factor, unit = UNITS[part.turns]
        residual = factor * fit.residual[part.rows, part.columns]
        _coordinates(part, residual, fit.standardised[part.rows, part.columns], ax)
        column = worst[part.rows] - part.columns.start
        here = (column >= 0) & (column < residual.shape[1])
        flagged = np.flatnonzero(np.isin(part.rows, fit.outliers) & here)
        if len(flagged):
            _circles(part.rows[flagged], residual[flagged, column[flagged]], ax)
        ax.set_ylabel(f"{'rotation ' * part.turns}residual [{unit}]")
        ax.grid(alpha=0.3)
        ax.legend(ncols=4, fontsize=9, frameon=False, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    ax.locator_params("x", integer=True)
    ax.set_xlabel("measurement (row of the file)")


def drawn_rows(residual: np.ndarray) -> Indices:
    """Rows of residuals (m, 3) that are drawn: all, or of many some and those that fit least."""
    m = len(residual)
    if m <= 2 * MOST:
        return np.arange(m)
    least = np.argpartition(-np.abs(residual).max(axis=1), MOST)[:MOST]
    return np.union1d(np.linspace(0, m - 1, MOST).astype(int), least)


def _coordinates(
    part: ResidualPanel, residual: np.ndarray, standardised: np.ndarray, ax: "Axes"
) -> None:
    """Three coordinates, or a distance, over a band of twice the noise."""
    shown = drawn_rows(residual)
    for j, name in enumerate(part.names):
        ax.plot(
            part.rows[shown] + 1,
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
