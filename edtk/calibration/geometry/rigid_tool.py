"""Distances between the markers of one tool, which are the same in all poses."""

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.system.typing import Array, Mask

SCATTERS = 10.0  # times its usual scatter a distance between two markers has changed
SHAPE = 2e-4  # [m] below it a change of a distance is left to the fit
EXPLAINED = 0.25  # of the change remains, where markers were swapped
ALIKE = 3.0  # times the least remaining change, two orders explain it alike
MOST_MARKERS = 5  # whose orders are tried
CLEARLY = 0.5  # times nearer to others, another visit shows the tool better
AGREE = 0.4  # of the visits, at least, that show the tool as it is
FEWEST = 5  # visits that can tell how it is
MOST_TRIED = 200  # visits whose shape is tried as that of all


@dataclass(frozen=True, eq=False)
class RigidTool:
    """Visits whose markers are not where those of other visits are beside each other.

    Attributes:
        swapped: Visit, and the markers whose positions are exchanged there.
        apart: Visit, the markers of which one is elsewhere on the tool, and by how much the
            distances to it differ [m].
    """

    swapped: tuple[tuple[int, tuple[str, ...]], ...] = ()
    apart: tuple[tuple[int, tuple[str, ...], float], ...] = ()


def rigid_tool(data: MarkerPositions) -> RigidTool:
    """Find swapped markers and markers that slipped, whatever the robot does.

    The usual distances are those of the visit with which most others agree: a median would be of
    neither kind where half of the visits have two markers swapped.

    Args:
        data: All visits; fewer than three markers tell nothing of which one is wrong.
    """
    k = len(data.markers)
    if k < 3 or len(data) < FEWEST:
        return RigidTool()
    x = data.measured
    apart = np.linalg.norm(x[:, :, None] - x[:, None], axis=-1)
    usual, least = _usual(apart)
    off = np.abs(apart - usual) > least
    swapped = []
    elsewhere = []
    for visit in np.flatnonzero(off.any(axis=(1, 2))):
        order = _order(apart[visit], usual) if data.seen[visit].all() else tuple(range(k))
        exchanged = tuple(data.markers[i] for i, j in enumerate(order) if i != j)
        if exchanged:
            swapped.append((int(visit), exchanged))
            continue
        alone = _alone(off[visit])
        if alone:
            size = float(np.nanmax(np.abs(apart[visit] - usual)))
            elsewhere.append((int(visit), tuple(data.markers[i] for i in alone), size))
    return RigidTool(tuple(swapped), tuple(elsewhere))


def _usual(apart: Array) -> tuple[Array, Array]:
    """The distances (k, k) of most visits, and by how much (k, k) one has to differ [m]."""
    whole = np.flatnonzero(np.isfinite(apart).all(axis=(1, 2)))
    if not len(whole):
        return np.full(apart.shape[1:], np.nan), np.full(apart.shape[1:], np.inf)
    tried = whole[np.unique(np.linspace(0, len(whole) - 1, MOST_TRIED).round().astype(int))]
    best = np.inf
    usual = apart[tried[0]]
    near: Mask = np.ones(len(whole), dtype=bool)
    for visit in tried:
        differ = np.abs(apart[whole] - apart[visit]).max(axis=(1, 2))
        share = max(float(np.quantile(differ, AGREE)), SHAPE / 2)
        # Where two halves of the visits differ, the first of them counts as the usual one.
        if share < CLEARLY * best:
            best = share
            near = differ <= share
    # The nearest visits understate the scatter; all that are within many times of it do not.
    least = np.zeros(apart.shape[1:])
    for _ in range(3):
        usual = np.median(apart[whole][near], axis=0)
        scatter = 1.4826 * np.median(np.abs(apart[whole][near] - usual), axis=0)
        least = np.maximum(SCATTERS * scatter, SHAPE)
        near = (np.abs(apart[whole] - usual) <= least).all(axis=(1, 2))
    return usual, least


def _order(apart: Array, usual: Array) -> tuple[int, ...]:
    """In which order the markers (k,) have the usual distances; their own unless far better."""
    k = len(usual)
    plain = tuple(range(k))
    if k > MOST_MARKERS:
        return plain
    sizes = {
        order: float(np.abs(apart - usual[np.ix_(order, order)]).max())
        for order in permutations(range(k))
    }
    # Of orders that explain a tool of two or three equal sides alike, that with fewest exchanges.
    likely = max(ALIKE * min(sizes.values()), SHAPE)
    alike = [order for order, size in sizes.items() if size <= likely]
    best = min(alike, key=lambda order: (sum(i != j for i, j in enumerate(order)), sizes[order]))
    return best if sizes[best] < EXPLAINED * sizes[plain] else plain


def _alone(off: Mask) -> list[int]:
    """The markers of which one alone may be elsewhere: all distances between others agree."""
    k = len(off)
    others = [np.delete(np.arange(k), i) for i in range(k)]
    return [i for i in range(k) if not off[np.ix_(others[i], others[i])].any()]
