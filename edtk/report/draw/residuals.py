"""Residuals of a fit, measurement by measurement, and poses that were left out."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from edtk.fit.fitted_geometry import GeometricFit, lengths
from edtk.fit.identify import Identification
from edtk.measure.pose_table import coordinate_names
from edtk.report.draw.posterior import thinned
from edtk.report.figures import BLUE, COLOURS, MARKERS, ORANGE
from edtk.robots.frames import MM
from edtk.system.typing import Array, Indices, Mask

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARKER_SHAPES = "osD"
# Measurements that are drawn evenly, and as many of the largest residuals.
DRAWN_MEASUREMENTS = 4000
TAIL = 1000  # of many points, so many at each end are drawn,
MIDDLE = 4000  # and so many of those between them, which hide each other
SHAPES_OF_MARKERS = "osD"


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
    if m <= 2 * DRAWN_MEASUREMENTS:
        return np.arange(m)
    least = np.argpartition(-np.abs(residual).max(axis=1), DRAWN_MEASUREMENTS)[:DRAWN_MEASUREMENTS]
    return np.union1d(np.linspace(0, m - 1, DRAWN_MEASUREMENTS).astype(int), least)


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
            marker=MARKER_SHAPES[j],
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


def marker_residuals(fit: GeometricFit, marker: int, ax: "Axes") -> None:
    """Draw the residuals of one marker [mm], over a band of twice their usual size.

    Args:
        fit: The fit.
        marker: Its index.
        ax: Where to draw.
    """
    residual = MM * fit.residual[:, marker]
    residual = residual[:, np.isfinite(residual).any(axis=0)]
    seen = np.flatnonzero(np.isfinite(residual).all(axis=1))
    shown = seen[thinned(np.abs(residual[seen]).max(axis=1))]
    for axis in range(residual.shape[1]):
        ax.plot(
            shown + 1,
            residual[shown, axis],
            linestyle="",
            marker=SHAPES_OF_MARKERS[axis],
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


def left_out_errors(fit: GeometricFit, ax: "Axes") -> None:
    """Draw the distance of each marker from where the other poses predict it [mm].

    More markers than there are colours are drawn alike: no legend tells them apart.
    """
    distance = MM * lengths(fit.left_out)
    names = fit.data.markers
    series = [(name, distance[:, [i]]) for i, name in enumerate(names)]
    if len(names) > len(COLOURS):
        series = [(f"each of {len(names)} markers", distance)]
    for i, (name, values) in enumerate(series):
        pose, marker = np.nonzero(np.isfinite(values))
        shown = thinned(values[pose, marker])
        ax.plot(
            pose[shown] + 1,
            values[pose[shown], marker[shown]],
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
