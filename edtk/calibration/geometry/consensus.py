"""Where the robot stands and the markers sit, by the visits that agree with each other."""

from dataclasses import dataclass

import numpy as np

from edtk.inference.geometry.linear_start import LinearStart, linear_start
from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.model.robot import Robot
from edtk.system.typing import Array, Indices

DRAWS = 80  # of a few poses each, of which one at least is likely free of errors
MOST = 0.5  # share of the visits that have to agree
SOME = 0.25  # likewise, where so many do not
SPARE = 4  # visits beside those of a draw, at least: some of them show whether these are sound
FAR = 0.02  # of the spread of positions: no drawing is as wrong


@dataclass(frozen=True, eq=False)
class Consensus:
    """A place of robot and markers, with the geometry of the drawing.

    Attributes:
        robot: The drawing.
        start: The place.
        distance: How far (v,) each visit is from it, root mean square [m].
        typical: The distance of the visits that agree [m].
    """

    robot: Robot
    start: LinearStart
    distance: Array
    typical: float

    @classmethod
    def of(cls, robot: Robot, data: MarkerPositions) -> "Consensus | None":
        """Of all visits; None where they are too few to tell.

        Robot and markers are placed by the linear problem from a few poses, many times; the place
        with the smallest median distance is that of poses without errors (Rousseeuw 1984). Where
        that is far off, less than half of the visits may be sound: then a quarter has to agree, and
        poses that follow each other are tried too, as sound ones often do.
        """
        flange = robot.forward(data.q)
        found = _least(robot, flange, data, MOST)
        spread = float(np.sqrt(np.nanmean((data.measured - _center(data)) ** 2) * 3))
        if found is not None and found.typical > FAR * spread:
            some = _least(robot, flange, data, SOME)
            found = some if some is not None and some.typical < FAR * spread else found
        return found

    def predict(self, q: Array) -> Array:
        """Positions (m, k, 3) of the markers in poses q (m, n) [m]."""
        return points_at(self.robot.forward(q), self.start)


def _least(robot: Robot, flange: Array, data: MarkerPositions, share: float) -> Consensus | None:
    """The place to which a share of the visits is nearest."""
    k = len(data.markers)
    few = -(-(12 + 3 * k) // (3 * k)) + 3
    if len(data) < few + SPARE:
        return None
    # Visits that were fitted agree by themselves: more than these have to.
    share = max(share, (few + 1) / len(data))
    rng = np.random.default_rng(0)
    draws: list[Indices] = [np.arange(len(data))]
    draws += [rng.choice(len(data), few, replace=False) for _ in range(DRAWS)]
    if share < MOST:
        firsts = np.unique(np.linspace(0, len(data) - few, DRAWS).astype(int))
        draws += [np.arange(first, first + few) for first in firsts]
    best: Consensus | None = None
    told = data.seen.any(axis=1)
    for chosen in draws:
        if not data.seen[chosen].any(axis=0).all():
            continue
        start = linear_start(flange[chosen], data.measured[chosen], data.seen[chosen])
        if not start.whole:
            continue
        distance = distances(data, points_at(flange, start))
        typical = float(np.quantile(distance[told], share))
        if best is None or typical < best.typical:
            best = Consensus(robot, start, distance, typical)
    return best


def points_at(flange: Array, start: LinearStart) -> Array:
    """Positions (m, k, 3) for transforms (m, 4, 4) of the tool frame."""
    local = flange[:, None, :3, 3] + np.einsum("mij,kj->mki", flange[:, :3, :3], start.tools)
    return np.asarray(local @ start.base[:3, :3].T + start.base[:3, 3])


def distances(data: MarkerPositions, points: Array) -> Array:
    """Root mean square distance (v,) of what was seen in each visit [m]."""
    squares = np.where(data.seen, ((data.measured - points) ** 2).sum(axis=-1), 0.0)
    return np.asarray(np.sqrt(squares.sum(axis=1) / np.maximum(data.seen.sum(axis=1), 1)))


def _center(data: MarkerPositions) -> Array:
    """The median (3,) of all positions [m]."""
    return np.asarray(np.median(data.measured[data.seen], axis=0))
