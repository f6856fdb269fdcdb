"""Visits whose positions cannot be those of the markers: swapped, of another pose, elsewhere."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from edtk.findings.finding import Data, Finding, Severity, Wording, rows_in_words
from edtk.findings.sound_rows import EXPLAINED, MOST_MARKERS, RigidTool
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.place_robot import LinearStart, linear_start, rigid_motion
from edtk.robots.joint import Joint
from edtk.robots.robot import Robot
from edtk.system.typing import Array, Indices

DEGREE = np.pi / 180
FAR = 0.02  # of the spread of positions: no drawing is as wrong
FEWEST_MOVED = 3  # visits one after the other that a motion of the frame has to explain
SCALES = {
    "metres": 1e-3,
    "decimetres": 1e-2,
    "centimetres": 1e-1,
    "inches": 1 / 25.4,
    "feet": 1 / 304.8,
    "micrometres": 1e3,
}
# What visits of which the others say something else look like, see `WrongVisit`.
OF_THE_REST = ("frame_moved", "joint_slipped")  # of these the others are no more right than they
WRONG = ("gross", *OF_THE_REST, "unit", "radians", "shifted", "coordinates", "typed")


@dataclass(frozen=True)
class TypedWrongly:
    """How a joint is searched that was typed wrongly."""

    most: int = 15  # visits: nobody mistypes more, and the search for each takes a while
    grid: int = 361  # values of a joint that are tried
    refined: int = 5  # times the grid about the best value is made ten times finer


TYPED = TypedWrongly()


@dataclass(frozen=True)
class AgreeingVisits:
    """How visits are found that agree with each other."""

    draws: int = 80  # of a few poses each, of which one at least is likely free of errors
    majority: float = 0.5  # share of the visits that have to agree
    minority: float = 0.25  # share that has to agree where more than half may be wrong
    # Visits beside those of a draw, at least: some of them show whether these are sound.
    spare: int = 4
    much_farther: float = 6.0  # times the typical distance: no pose of a sound sheet is as far off
    least_distance: float = 2e-3  # [m] below it a distance is left to the fit
    few_left: float = 0.6  # share of the visits that count, below which these may be the wrong ones


AGREE = AgreeingVisits()


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
        found = _least(robot, flange, data, AGREE.majority)
        spread = float(np.sqrt(np.nanmean((data.measured - _center(data)) ** 2) * 3))
        if found is not None and found.typical > FAR * spread:
            some = _least(robot, flange, data, AGREE.minority)
            found = some if some is not None and some.typical < FAR * spread else found
        return found

    def predict(self, q: Array) -> Array:
        """Positions (m, k, 3) of the markers in poses q (m, n) [m]."""
        return points_at(self.robot.forward(q), self.start)


def _least(robot: Robot, flange: Array, data: MarkerPositions, share: float) -> Consensus | None:
    """The place to which a share of the visits is nearest."""
    k = len(data.markers)
    few = -(-(12 + 3 * k) // (3 * k)) + 3
    if len(data) < few + AGREE.spare:
        return None
    # Visits that were fitted agree by themselves: more than these have to.
    share = max(share, (few + 1) / len(data))
    rng = np.random.default_rng(0)
    draws: list[Indices] = [np.arange(len(data))]
    draws += [rng.choice(len(data), few, replace=False) for _ in range(AGREE.draws)]
    if share < AGREE.majority:
        firsts = np.unique(np.linspace(0, len(data) - few, AGREE.draws).astype(int))
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


Left = Callable[[Array, Array], Array]  # distances of positions (k, 3) from those of poses (m, n)


@dataclass(frozen=True)
class WrongVisit:
    """A visit that is not fitted.

    Attributes:
        visit: Its number.
        distance: How far it is off [m].
        kind: A word for programs; "gross" where nothing explains it.
        words: What explains it, for people; empty likewise.
    """

    visit: int
    distance: float
    kind: str = "gross"
    words: str = ""


def explain_visits(
    agreed: Consensus, data: MarkerPositions, visits: list[int], near: float
) -> tuple[WrongVisit, ...]:
    """Find for each visit what would bring it where the others say.

    A motion of the frame, and then one joint that is as much further than written in all, is tried
    for visits one after the other. Then units, the pose of the row
    before or after, exchanged coordinates, and one joint that was typed wrongly.

    Args:
        agreed: Where the others say.
        data: All visits.
        visits: Those that are far off.
        near: A distance [m] as small as that of sound visits.
    """
    moved = _moved(agreed, data, visits, near)
    found = []
    for visit in visits:
        own = float(agreed.distance[visit])
        kind, words = moved.get(visit, ("", ""))
        if not kind:
            limit = min(near, EXPLAINED * own)
            causes = _causes(agreed, data, visit, typed=len(visits) <= TYPED.most)
            kind, words = next(
                ((kind, words) for kind, words, left in causes if left < limit), ("gross", "")
            )
        found.append(WrongVisit(visit, own, kind, words))
    return tuple(found)


def _moved(
    agreed: Consensus, data: MarkerPositions, visits: list[int], near: float
) -> dict[int, tuple[str, str]]:
    """Runs of visits that one rigid motion brings back."""
    found: dict[int, tuple[str, str]] = {}
    breaks = np.flatnonzero(np.diff(visits) > 1) + 1
    for run in np.split(np.array(visits, dtype=int), breaks):
        if len(run) < FEWEST_MOVED:
            continue
        seen = data.seen[run]
        measured = data.measured[run][seen]
        predicted = agreed.predict(data.q[run])[seen]
        T = rigid_motion(measured, predicted)
        left = measured @ T[:3, :3].T + T[:3, 3] - predicted
        size = float(np.sqrt((left**2).sum(axis=-1).mean()))
        limit = min(near, EXPLAINED * float(agreed.distance[run].min()))
        if size < limit:
            words = "as if the instrument's frame or the robot's base had moved"
            found |= dict.fromkeys(run.tolist(), ("frame_moved", words))
        elif words := _slipped(agreed, data, run, limit):
            found |= dict.fromkeys(run.tolist(), ("joint_slipped", words))
    return found


def _slipped(agreed: Consensus, data: MarkerPositions, run: Indices, limit: float) -> str:
    """One joint that is as much further than written in all visits of a run; empty for none.

    By how much the middle visit tells, and all others have to agree with it.
    """
    middle = run[len(run) // 2]
    runs = data[run]
    left = _left(agreed, data, middle)
    for j, off, _ in _others(agreed, left, data.measured[middle], data.q[middle]):
        q = runs.q.copy()
        q[:, j] -= off
        if np.sqrt(np.mean(distances(runs, agreed.predict(q)) ** 2)) < limit:
            joint = agreed.robot.joints[j]
            return f"as if the zero of {joint.name} had slipped by {_in_words(joint, -off)}"
    return ""


def _left(agreed: Consensus, data: MarkerPositions, visit: int) -> Left:
    """How far positions of a visit are off in other poses, or others in its own."""
    seen = data.seen[visit]

    def left(measured: Array, poses: Array) -> Array:
        apart = (measured - agreed.predict(poses))[:, seen]
        return np.asarray(np.sqrt((apart**2).sum(axis=-1).mean(axis=-1)))

    return left


def _causes(
    agreed: Consensus, data: MarkerPositions, visit: int, typed: bool
) -> Iterator[tuple[str, str, float]]:
    """Kind, words and what is left [m] of each cause, the most likely first."""
    robot = agreed.robot
    q = data.q[visit]
    x = data.measured[visit]
    left = _left(agreed, data, visit)
    for unit, scale in SCALES.items():
        yield "unit", f"as if in {unit}", float(left(x / scale, q[None])[0])
    turned = np.where(robot.slides, q, q / DEGREE)
    yield "radians", "as if angles were in radians", float(left(x, turned[None])[0])
    for step, which in ((-1, "before"), (1, "after")):
        if 0 <= visit + step < len(data):
            own = float(left(x, data.q[[visit + step]])[0])
            yield "shifted", f"as if they were of the pose {which}", own
    yield from _coordinates(left, x, q)
    if typed:
        yield from _typed(agreed, left, x, q)


def _coordinates(left: Left, x: Array, q: Array) -> Iterator[tuple[str, str, float]]:
    """Coordinates that are exchanged or have the other sign."""
    for order, signs in product(permutations(range(3)), product((1, -1), repeat=3)):
        exchanged = ["xyz"[i] for i in range(3) if order[i] != i]
        other = ["xyz"[i] for i in range(3) if signs[i] < 0]
        parts = [f"{' and '.join(exchanged)} exchanged"] if exchanged else []
        parts += [f"the sign of {' and '.join(other)} turned"] if other else []
        if parts:
            again = (x * signs)[:, list(order)]
            yield "coordinates", f"as if {' and '.join(parts)}", float(left(again, q[None])[0])


def _typed(agreed: Consensus, left: Left, x: Array, q: Array) -> Iterator[tuple[str, str, float]]:
    """One joint with another value."""
    for j, off, size in _others(agreed, left, x, q):
        joint = agreed.robot.joints[j]
        yield "typed", f"as if {joint.name} were typed wrongly, by {_in_words(joint, off)}", size


def _others(
    agreed: Consensus, left: Left, x: Array, q: Array
) -> Iterator[tuple[int, float, float]]:
    """Of each joint by how much it is further than a value that fits, and what that leaves [m].

    It is the best value of a grid that becomes finer.
    """
    for j, joint in enumerate(agreed.robot.joints):
        low, high = joint.limits if joint.kind == "prismatic" else (-np.pi, np.pi)
        best = q[j]
        size = np.inf
        for _ in range(TYPED.refined):
            values = np.linspace(low, high, TYPED.grid)
            poses = np.tile(q, (TYPED.grid, 1))
            poses[:, j] = values
            errors = left(x, poses)
            best = float(values[errors.argmin()])
            size = float(errors.min())
            low, high = best - (high - low) / 20, best + (high - low) / 20
        yield j, float(q[j] - best), size


def _in_words(joint: Joint, size: float) -> str:
    """A motion of a joint [rad or m], for people."""
    if joint.kind == "prismatic":
        return f"{1e3 * size:.3g} mm"
    return f"{size / DEGREE:.3g} deg"


@dataclass(frozen=True, eq=False)
class GrossErrors:
    """Visits that do not fit the others.

    Attributes:
        swapped: Visit, and the markers whose positions are exchanged there.
        wrong: Other visits that are far off.
        apart: Visits in which one marker is elsewhere on the tool: see `RigidTool`.
    """

    swapped: tuple[tuple[int, tuple[str, ...]], ...] = ()
    wrong: tuple[WrongVisit, ...] = ()
    apart: tuple[tuple[int, tuple[str, ...], float], ...] = ()

    @property
    def visits(self) -> list[int]:
        """All that do not count."""
        return sorted({visit for visit, _ in self.swapped} | {one.visit for one in self.wrong})


def gross_errors(robot: Robot, data: MarkerPositions, rigid: RigidTool) -> GrossErrors:
    """Find visits far from where the others say that they are, and what is wrong with them.

    Distances between markers of one tool are the same in all poses whatever the robot does: they
    show swaps and markers that slipped. Then visits much farther from the place that the others
    agree with than these are looked at: positions of swapped markers fit in another order, and
    others in another unit, at another pose or after a motion of the frame.

    Args:
        robot: The drawing, whose own errors make the typical distance.
        data: All visits.
        rigid: What distances between markers show of these.
    """
    sound = rigid.without_swapped(rigid.without_apart(data))
    agreed = Consensus.of(robot, sound)
    if agreed is None:
        return GrossErrors(rigid.swapped, (), rigid.apart)
    return _far(agreed, sound, rigid)


def _far(agreed: Consensus, data: MarkerPositions, rigid: RigidTool) -> GrossErrors:
    """The visits that are far off."""
    near = max(AGREE.much_farther * agreed.typical, AGREE.least_distance)
    predicted = agreed.predict(data.q)
    swapped = list(rigid.swapped)
    wrong: list[int] = []
    for visit in np.flatnonzero(agreed.distance > near):
        order = _order(data.measured[visit], predicted[visit], data.seen[visit])
        exchanged = tuple(data.markers[i] for i, j in enumerate(order) if i != j)
        if exchanged:
            swapped.append((int(visit), exchanged))
        else:
            wrong.append(int(visit))
    explained = explain_visits(agreed, data, wrong, near)
    return GrossErrors(tuple(sorted(swapped)), explained, rigid.apart)


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


def gross_findings(data: MarkerPositions, found: GrossErrors) -> list[Finding]:
    """A finding for each set of markers that were swapped or apart, and for each other cause.

    Args:
        data: All visits.
        found: Those that were not fitted.
    """
    findings = []
    many = len(found.visits) > (1 - AGREE.few_left) * len(data)
    severity = Severity.ALARM if many else Severity.WARNING
    for markers in dict.fromkeys(markers for _, markers in found.swapped):
        rows = _rows(data, [visit for visit, own in found.swapped if own == markers])
        findings.append(Finding.of(severity, WORDING, "swapped", rows=rows, markers=markers))
    for names in dict.fromkeys(markers for _, markers, _ in found.apart):
        findings.append(_apart(data, found, names))
    for cause in dict.fromkeys((one.kind, one.words) for one in found.wrong):
        own = [one for one in found.wrong if (one.kind, one.words) == cause]
        findings.append(_wrong(data, own, severity))
    return findings


def _apart(data: MarkerPositions, found: GrossErrors, names: tuple[str, ...]) -> Finding:
    """The visits in which one marker is elsewhere on the tool."""
    own = [(visit, size) for visit, markers, size in found.apart if markers == names]
    columns = [data.markers.index(name) for name in names]
    rows = tuple(sorted({int(row) for visit, _ in own for row in data.row[visit, columns]}))
    off = max(size for _, size in own)
    return Finding.of(Severity.WARNING, WORDING, "apart", rows=rows, markers=names, off=off)


def _wrong(data: MarkerPositions, visits: list[WrongVisit], severity: Severity) -> Finding:
    """The visits with one cause."""
    rows = _rows(data, [one.visit for one in visits])
    off = max(one.distance for one in visits)
    kind = visits[0].kind
    worst = Severity.ALARM if kind in OF_THE_REST else severity
    return Finding.of(worst, WORDING, kind, rows=rows, off=off, why=visits[0].words)


def _rows(data: MarkerPositions, visits: list[int]) -> tuple[int, ...]:
    """Rows of the file that some visits are in."""
    rows = {int(row) for visit in visits for row in data.row[visit] if row >= 0}
    return tuple(sorted(rows))


def _wrong_words(data: Data) -> str:
    """Positions that are far off, and what put them there where that is known."""
    why = f", {data['why']}; these" if data["why"] else "; is the pose another one? These"
    return (
        f"{rows_in_words(data['rows'])}: positions are up to {1e3 * data['off']:.3g} mm from where "
        f"all others say{why} rows do not count"
    )


WORDING: Wording = {
    "swapped": lambda data: (
        f"{rows_in_words(data['rows'])}: markers {' and '.join(data['markers'])} are swapped; "
        "these rows do not count"
    ),
    "apart": lambda data: (
        f"{rows_in_words(data['rows'])}: marker {' or '.join(data['markers'])} is up to "
        f"{1e3 * data['off']:.3g} mm from its usual distance to the other markers; a slip, or a "
        "false reading? These positions do not count"
    ),
    **dict.fromkeys(WRONG, _wrong_words),
}
