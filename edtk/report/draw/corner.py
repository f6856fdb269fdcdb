"""Histograms and pairwise clouds of a posterior."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.report.draw.labelled_samples import LabelledSamples
from edtk.report.palette import BLUE, ORANGE
from edtk.system.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_POINTS = 20_000  # of a cloud; more only make its contours slower
EDGES = (0.0005, 0.9995)  # quantiles that are shown
CLOUD = (0.865, 0.393)  # of the points inside two deviations and one of a plane normal
BINS = 30  # of a cloud, along each axis


def corner(shown: LabelledSamples, axes: np.ndarray) -> None:
    """Draw each unknown, and each pair of them with contours of 39 % and 86 %.

    Args:
        shown: The samples.
        axes: Axes (d, d); those above the diagonal stay empty.
    """
    d = len(shown.labels)
    points = shown.samples.reshape(-1, d)
    points = points[:: max(1, len(points) // MOST_POINTS)]
    for i in range(d):
        for j in range(d):
            if j > i:
                axes[i, j].set_axis_off()
            else:
                _panel(shown, points, i, j, axes[i, j])


def _panel(shown: LabelledSamples, points: Array, i: int, j: int, ax: "Axes") -> None:
    """Unknown i over unknown j, or one of them alone."""
    low, high = np.quantile(points[:, j], EDGES)
    ax.set_xlim(low, high)
    ax.locator_params(nbins=3)
    ax.tick_params(labelsize=7)
    if i == j:
        ax.hist(points[:, j], bins=50, range=(low, high), color=BLUE, alpha=0.6)
        ax.set_yticks([])
    else:
        _cloud(ax, points[:, j], points[:, i])
        ax.set_ylim(*np.quantile(points[:, i], EDGES))
        ax.axhline(shown.reference[i], color=ORANGE, linewidth=1)
    ax.axvline(shown.reference[j], color=ORANGE, linewidth=1)
    if i == len(shown.labels) - 1:
        ax.set_xlabel(shown.labels[j], fontsize=8)
    if j == 0 and i > 0:
        ax.set_ylabel(shown.labels[i], fontsize=8)
    elif j < i:
        ax.set_yticklabels([])


def _cloud(ax: "Axes", x: Array, y: Array) -> None:
    """Filled contours of the histogram at the heights that hold 39 % and 86 % of the points."""
    counts, x_edges, y_edges = np.histogram2d(x, y, bins=BINS)
    smooth = np.pad(counts, 1)
    smooth = smooth[:-2] + 2 * smooth[1:-1] + smooth[2:]
    smooth = (smooth[:, :-2] + 2 * smooth[:, 1:-1] + smooth[:, 2:]) / 16
    heights = np.sort(smooth.ravel())[::-1]
    mass = np.cumsum(heights) / heights.sum()
    levels = [heights[np.searchsorted(mass, share)] for share in CLOUD]
    middle = [0.5 * (edges[1:] + edges[:-1]) for edges in (x_edges, y_edges)]
    # Few samples may give both contours the same height, which matplotlib refuses.
    if levels[0] < levels[1] < smooth.max():
        filled = [*levels, smooth.max()]
        ax.contourf(*middle, smooth.T, levels=filled, colors=[BLUE, BLUE], alpha=0.35)
        ax.contour(*middle, smooth.T, levels=levels, colors=BLUE, linewidths=0.8)
