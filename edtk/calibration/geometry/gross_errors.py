"""Poses whose positions cannot be those of the markers: swapped, or of another pose."""

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from edtk.inference.geometry.linear_start import linear_start
from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.model.robot import Robot
from edtk.system.typing import Array, Indices

DRAWS = 80  # of a few poses each, of which one at least is likely free of errors
MUCH = 6.0  # times the median distance: no pose of a sound sheet is as far off
LEAST = 2e-3  # [m] below it a distance is left to the fit
SCATTERS = 10.0  # times the usual scatter a distance between two markers has changed
SHAPE = 2e-4  # [m] below it a change of a distance is left to the fit
EXPLAINED = 0.25  # of the distance remains, where markers were swapped
MOST_MARKERS = 5  # whose orders are tried


@dataclass(frozen=True, eq=False)
class GrossErrors:
    """Visits that do not fit the others.

    Attributes:
        swapped: Visit, and the markers whose positions are exchanged there.
        wrong: Other visits that are far off, each with its distance [m].
    """

    swapped: tuple[tuple[int, tuple[str, ...]], ...]
    wrong: tuple[tuple[int, float], ...]

    @property
    def visits(self) -> list[int]:
        """All of them."""
        return sorted([visit for visit, _ in self.swapped] + [visit for visit, _ in self.wrong])


def gross_errors(robot: Robot, data: MarkerPositions) -> GrossErrors:
    """Find visits far from where the others say that they are.

    Base and markers are placed by the linear problem from a few poses, many times; the place with
    the smallest median distance is that of poses without errors (Rousseeuw 1984). Then visits much
    farther off than the median are looked at: positions of swapped markers fit in another order.

    Distances between markers of one tool are the same in all poses whatever the robot does. They
    show a swap first, and more finely.

    Args:
        robot: The drawing, whose own errors make the median.
        data: All visits.
    """
    rigid = _by_distances(data)
    if rigid:
        return GrossErrors(rigid, ())
    flange = robot.forward(data.q)
    distance, predicted = _agreed(flange, data)
    if distance is None or predicted is None:
        return GrossErrors((), ())
    typical = float(np.nanmedian(distance))
    swapped: list[tuple[int, tuple[str, ...]]] = []
    wrong: list[tuple[int, float]] = []
    for visit in np.flatnonzero(distance > max(MUCH * typical, LEAST)):
        order = _order(data.measured[visit], predicted[visit], data.seen[visit])
        exchanged = [data.markers[i] for i, j in enumerate(order) if i != j]
        if exchanged:
            swapped.append((int(visit), tuple(exchanged)))
        else:
            wrong.append((int(visit), float(distance[visit])))
    return GrossErrors(tuple(swapped), tuple(wrong))


def _by_distances(data: MarkerPositions) -> tuple[tuple[int, tuple[str, ...]], ...]:
    """Visits whose distances between markers are those of other visits in another order."""
    k = len(data.markers)
    if not 2 < k <= MOST_MARKERS:
        return ()
    x = data.measured
    apart = np.linalg.norm(x[:, :, None] - x[:, None], axis=-1)
    usual = np.nanmedian(apart, axis=0)
    scatter = 1.4826 * np.nanmedian(np.abs(apart - usual), axis=0)
    least = np.maximum(SCATTERS * scatter, SHAPE)
    found = []
    for visit in np.flatnonzero((np.abs(apart - usual) > least).any(axis=(1, 2))):
        if not data.seen[visit].all():
            continue
        orders = {}
        for order in permutations(range(k)):
            index = np.ix_(order, order)
            orders[order] = float(np.abs(apart[visit] - usual[index]).max())
        best = min(orders, key=orders.__getitem__)
        plain = orders[tuple(range(k))]
        if orders[best] < EXPLAINED * plain:
            exchanged = tuple(data.markers[i] for i, j in enumerate(best) if i != j)
            found.append((int(visit), exchanged))
    return tuple(found)


def _agreed(flange: Array, data: MarkerPositions) -> tuple[Array | None, Array | None]:
    """Distances (v,) of visits from the place that most agree with, and positions (v, k, 3)."""
    k = len(data.markers)
    few = -(-(12 + 3 * k) // (3 * k)) + 3
    if len(data) < 2 * few:
        return None, None
    rng = np.random.default_rng(0)
    best = np.inf
    found: tuple[Array | None, Array | None] = (None, None)
    everything = np.arange(len(data))
    for draw in range(DRAWS + 1):
        chosen: Indices = everything if not draw else rng.choice(len(data), few, replace=False)
        if not data.seen[chosen].any(axis=0).all():
            continue
        start = linear_start(flange[chosen], data.measured[chosen], data.seen[chosen])
        if not start.whole:
            continue
        local = flange[:, None, :3, 3] + np.einsum("mij,kj->mki", flange[:, :3, :3], start.tools)
        points = local @ start.base[:3, :3].T + start.base[:3, 3]
        apart = np.linalg.norm(data.measured - points, axis=-1)
        apart = np.where(data.seen, apart, 0.0)
        count = np.maximum(data.seen.sum(axis=1), 1)
        distance = np.sqrt((apart**2).sum(axis=1) / count)
        median = float(np.median(distance))
        if median < best:
            best = median
            found = (distance, points)
    return found


def _order(measured: Array, predicted: Array, seen: Array) -> tuple[int, ...]:
    """In which order the markers (k,) of a visit fit best; their own unless far better."""
    there = np.flatnonzero(seen)
    plain = tuple(range(len(measured)))
    if not 1 < len(there) <= MOST_MARKERS:
        return plain
    own = np.linalg.norm(measured[there] - predicted[there])
    sizes = {}
    for order in permutations(there.tolist()):
        sizes[order] = float(np.linalg.norm(measured[there] - predicted[list(order)]))
    best = min(sizes, key=sizes.__getitem__)
    if sizes[best] > EXPLAINED * own:
        return plain
    found = list(plain)
    for place, one in zip(there.tolist(), best, strict=True):
        found[place] = one
    return tuple(found)
