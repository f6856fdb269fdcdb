"""How a sheet counts the joints, where it is not as the study says."""

from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np

from edtk.findings.gross_errors import DEGREE, FAR, distances, points_at
from edtk.fit.controller.find_controller import MOST_JOINTS
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.place_robot import LinearStart, linear_misfits, linear_start, rigid_motion
from edtk.robots.robot import Robot
from edtk.system.typing import Array


@dataclass(frozen=True)
class SearchOfWays:
    """How ways to count are searched, and when one is believed."""

    most_visits: int = 40  # that a search looks at
    # Times better, another way to count is believed, or another reading of orientations.
    much_better: float = 4.0
    # Two ways, or readings of orientations, whose distances differ by less are equally good. Every
    # change has to pay for itself: one of a joint that stands still in most visits fits these as
    # well, and makes the others look wrong.
    alike: float = 1.5
    # Times the distance of the best way: a visit farther off does not fit at all.
    beyond_fit: float = 10.0
    kept_share: float = 0.75  # of the visits place the robot where a few may be wrong
    placing_turns: int = 5  # of placing it and of choosing these visits
    most_ways: int = 24  # ways to count that are looked at with a part of the visits
    at_once: int = 100  # of all ways: more are no faster, and take their memory
    # Of the size of all positions: two misfits by normal equations that differ by less may be
    # alike.
    rounding: float = 1e-6


SEARCH = SearchOfWays()


@dataclass(frozen=True, eq=False)
class Counting:
    """How joint variables follow from those of a sheet: ``q = C q_sheet``.

    Attributes:
        matrix: C (n, n): signs on its diagonal, and where a joint follows the one before it.
        words: What is different, for people; empty where nothing is.
        exchanged: Whether columns are exchanged, which no controller does.
    """

    matrix: Array
    words: str = ""
    exchanged: bool = False

    def of(self, data: MarkerPositions) -> MarkerPositions:
        """The same positions with the joint variables that are meant."""
        return replace(data, q=data.q @ self.matrix.T) if self.words else data

    def turned(self, q: Array) -> Array:
        """Joint variables (m, n) that are meant by those of a sheet."""
        return q @ self.matrix.T if self.words else q

    def back(self, q: Array) -> Array:
        """Joint variables (m, n) of a sheet for those that are meant."""
        return q @ np.linalg.inv(self.matrix).T if self.words else q


def as_said(robot: Robot) -> Counting:
    """The way to count of the study."""
    return Counting(np.eye(robot.n))


def placed(robot: Robot, data: MarkerPositions, matrix: Array | None = None) -> LinearStart:
    """The linear place of robot and markers, for joint variables times a matrix."""
    q = data.q if matrix is None else data.q @ matrix.T
    return linear_start(robot.forward(q), data.measured, data.seen)


def placed_by_most(robot: Robot, data: MarkerPositions, matrix: Array | None = None) -> LinearStart:
    """The same by the visits that fit best, in turns (Rousseeuw and Van Driessen 2006)."""
    start = placed(robot, data, matrix)
    flange = robot.forward(data.q if matrix is None else data.q @ matrix.T)
    count = int(np.ceil(SEARCH.kept_share * len(data)))
    for _ in range(SEARCH.placing_turns):
        if not start.whole or not start.scale < np.inf:
            break
        local = flange[:, None, :3, 3] + np.einsum("mij,kj->mki", flange[:, :3, :3], start.tools)
        x = data.measured / start.scale
        apart = x - local @ start.base[:3, :3].T
        squares = ((apart - np.median(apart[data.seen], axis=0)) ** 2).sum(axis=-1)
        size = np.nanmax(np.where(data.seen, squares, -1.0), axis=1)
        chosen = np.sort(np.argsort(size, kind="stable")[:count])
        again = linear_start(flange[chosen], data.measured[chosen], data.seen[chosen])
        if not again.whole:
            break
        start = again
    return start


def far_off(start: LinearStart, data: MarkerPositions) -> bool:
    """Whether the drawing is so far from the positions that something else is wrong."""
    size = start.rms * (start.scale if np.isfinite(start.scale) else 1.0)
    return size > FAR * _spread(data) or (start.whole and (start.mirrored or start.distorted))


def find_counting(
    robot: Robot, data: MarkerPositions, places: Array | None = None
) -> Counting | None:
    """Find signs of the joints, and a joint that follows the one before it, by which all fits.

    A controller may count joints the other way, and that of an arm with a parallelogram may count
    the elbow from the horizontal. Of ways that fit equally well that with the fewest changes
    counts. Where a link is of another length, another way may fit better with markers wherever they
    are best: it is not believed if it does not with the markers where the study has them.

    Args:
        robot: The drawing.
        data: Positions with the joint variables of the sheet.
        places: Where the markers are on the tool (k, 3) [m]; zero, or None, where nobody said.

    Returns:
        The way to count; None where none fits much better than that of the study.
    """
    n = robot.n
    if n > MOST_JOINTS:
        return None
    few = _thinned(data)
    still = placed_by_most(robot, few)
    found = _least(robot, few, still, _likely(robot, few, _ways(robot, few)))
    if found is None or places is None or not places.any():
        return found
    here, there = (_off_places(robot, few, places, C) for C in (np.eye(n), found.matrix))
    return found if there < here else None


def _ways(robot: Robot, few: MarkerPositions) -> list[tuple[int, Counting]]:
    """All ways that are tried: signs, a joint that follows, two columns; with their changes."""
    n = robot.n
    names = robot.joint_names
    moving = np.ptp(few.q, axis=0) > DEGREE / 10
    choices = [(1, -1) if one else (1,) for one in moving]
    ways = []
    for signs in product(*choices):
        for follower, by in [(0, 0), *((j, s) for j in range(1, n) for s in (1, -1))]:
            if follower and not (moving[follower] and moving[follower - 1] and n > 3):
                continue
            matrix = np.diag(np.array(signs, dtype=float))
            if follower:
                matrix[follower] += by * matrix[follower - 1]
            turned = [name for name, sign in zip(names, signs, strict=True) if sign < 0]
            changes = len(turned) + 2 * bool(follower)
            ways.append((changes, Counting(matrix, _words(turned, names, follower, by))))
    return ways + [(3, one) for one in _exchanges(names, moving)]


def _likely(
    robot: Robot, few: MarkerPositions, ways: list[tuple[int, Counting]]
) -> list[tuple[float, int, Counting]]:
    """The `SEARCH.most_ways` that fit best, and those that fit alike; with how well they do."""
    turned = np.array([way.matrix.T for _, way in ways])
    rough = np.concatenate(
        [
            linear_misfits(robot.forward(few.q @ some), few.measured, few.seen)
            for some in np.split(turned, range(SEARCH.at_once, len(turned), SEARCH.at_once))
        ]
    )
    found: list[tuple[float, int, Counting]] = []
    limit = np.inf
    for i in np.argsort(rough, kind="stable"):
        if rough[i] > limit:
            break
        changes, way = ways[i]
        start = placed(robot, few, way.matrix)
        if way.exchanged or (start.whole and not start.mirrored):
            found.append((start.rms, changes, way))
        if len(found) == SEARCH.most_ways:
            limit = (1 + SEARCH.rounding) * rough[i] + SEARCH.rounding * _spread(few)
    return found


def _off_places(robot: Robot, few: MarkerPositions, places: Array, matrix: Array) -> float:
    """How far markers are from their places in the middle, with the base where it fits best [m]."""
    pose, marker = np.nonzero(few.seen & places.any(axis=1))
    flange = robot.forward(few.q[pose] @ matrix.T)
    drawn = flange[:, :3, 3] + (flange[:, :3, :3] @ places[marker][..., None])[..., 0]
    measured = few.measured[pose, marker]
    base = rigid_motion(drawn, measured)
    left = measured - drawn @ base[:3, :3].T - base[:3, 3]
    return float(np.median(np.linalg.norm(left, axis=1)))


def _exchanges(names: tuple[str, ...], moving: Array) -> list[Counting]:
    """The ways in which two columns may be exchanged."""
    found = []
    for i, j in combinations(np.flatnonzero(moving).tolist(), 2):
        order = list(range(len(names)))
        order[i], order[j] = j, i
        words = f"the columns of {names[i]} and {names[j]} are exchanged"
        found.append(Counting(np.eye(len(names))[order], words, exchanged=True))
    return found


def _least(
    robot: Robot,
    few: MarkerPositions,
    still: LinearStart,
    ways: list[tuple[float, int, Counting]],
) -> Counting | None:
    """The way that fits best, of those that fit alike the one with the fewest changes.

    Args:
        robot: The drawing.
        few: Some of the visits, a few of which may be wrong.
        still: The place with the way to count of the study.
        ways: For each way how well it fits all these visits, and its number of changes.
    """
    ways = sorted(ways, key=lambda one: one[:2])[: SEARCH.most_ways]
    starts = [placed_by_most(robot, few, way.matrix) for _, _, way in ways]
    sound = [
        (start, changes, way)
        for start, (_, changes, way) in zip(starts, ways, strict=True)
        if start.whole and not start.mirrored
    ]
    if not sound:
        return None
    limit = SEARCH.beyond_fit * min(start.rms for start, _, _ in sound) + 1e-9
    sizes = [_bounded(robot, few, start, way, limit) for start, _, way in sound]
    alike = [
        one
        for one, size in zip(sound, sizes, strict=True)
        if size <= SEARCH.alike * min(sizes) + 1e-9
    ]
    start, _, way = min(alike, key=lambda one: one[1])
    if not way.words or far_off(start, few):
        return None
    if still.rms < SEARCH.much_better * start.rms and not still.mirrored:
        return None
    return way


def _bounded(
    robot: Robot, few: MarkerPositions, start: LinearStart, way: Counting, limit: float
) -> float:
    """Root mean square distance of all visits, none counted as farther off than a limit [m].

    A start by most visits is not judged by these alone: a way that makes sound visits look wrong
    is worse than one that fits them.
    """
    apart = distances(few, points_at(robot.forward(few.q @ way.matrix.T), start))
    return float(np.sqrt((np.minimum(apart, limit) ** 2).mean()))


def in_radians(robot: Robot, data: MarkerPositions) -> bool:
    """Whether the sheet's degrees fit far better as radians."""
    matrix = np.diag(np.where(robot.slides, 1.0, 1 / DEGREE))
    meant = placed_by_most(robot, data, matrix)
    return meant.whole and not far_off(meant, data)


def one_in_radians(robot: Robot, data: MarkerPositions) -> str | None:
    """The joint whose degrees fit far better as radians, if one alone is written so."""
    for j in np.flatnonzero(~robot.slides):
        scale = np.ones(robot.n)
        scale[j] /= DEGREE
        meant = placed_by_most(robot, data, np.diag(scale))
        if meant.whole and not far_off(meant, data):
            return robot.joint_names[j]
    return None


def in_metres(robot: Robot, data: MarkerPositions) -> bool:
    """Whether the sheet's millimetres of prismatic joints fit far better as metres."""
    slides = robot.slides
    if not slides.any():
        return False
    meant = placed_by_most(robot, data, np.diag(np.where(slides, 1e3, 1.0)))
    return meant.whole and not far_off(meant, data)


def _words(turned: list[str], names: tuple[str, ...], follower: int, by: int) -> str:
    """What is different, for people."""
    parts = []
    if turned:
        parts.append(f"{', '.join(turned)} count{'s' * (len(turned) == 1)} the other way")
    if follower:
        how = "with" if by > 0 else "against"
        parts.append(f"{names[follower]} turns {how} {names[follower - 1]}")
    return " and ".join(parts)


def _thinned(data: MarkerPositions) -> MarkerPositions:
    """Poses spread over all."""
    chosen = np.unique(np.linspace(0, len(data) - 1, SEARCH.most_visits).round().astype(int))
    return data[chosen]


def _spread(data: MarkerPositions) -> float:
    """Root mean square distance of all positions from their mean [m]."""
    x = data.measured[data.seen]
    return float(np.sqrt(((x - x.mean(axis=0)) ** 2).sum(axis=-1).mean()))
