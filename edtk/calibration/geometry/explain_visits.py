"""What is wrong with visits that are far from where all others say."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from edtk.calibration.geometry.consensus import Consensus
from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.inference.geometry.rigid_motion import rigid_motion
from edtk.system.typing import Array

Left = Callable[[Array, Array], Array]  # distances of positions (k, 3) from those of poses (m, n)

SCALES = {
    "metres": 1e-3,
    "decimetres": 1e-2,
    "centimetres": 1e-1,
    "inches": 1 / 25.4,
    "feet": 1 / 304.8,
    "micrometres": 1e3,
}
EXPLAINED = 0.25  # of the distance remains at most
FEWEST = 3  # visits one after the other that a motion of the frame has to explain
MOST_TYPED = 15  # visits: nobody mistypes more, and the search for each takes a while
GRID = 361  # values of a joint that are tried
REFINED = 5  # times the grid about the best value is made ten times finer
DEGREE = np.pi / 180


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

    A motion of the frame is tried for visits one after the other. Then units, the pose of the row
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
            causes = _causes(agreed, data, visit, typed=len(visits) <= MOST_TYPED)
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
        if len(run) < FEWEST:
            continue
        seen = data.seen[run]
        measured = data.measured[run][seen]
        predicted = agreed.predict(data.q[run])[seen]
        T = rigid_motion(measured, predicted)
        left = measured @ T[:3, :3].T + T[:3, 3] - predicted
        size = float(np.sqrt((left**2).sum(axis=-1).mean()))
        if size < min(near, EXPLAINED * float(agreed.distance[run].min())):
            words = "as if the instrument's frame or the robot's base had moved"
            found |= dict.fromkeys(run.tolist(), ("frame_moved", words))
    return found


def _causes(
    agreed: Consensus, data: MarkerPositions, visit: int, typed: bool
) -> Iterator[tuple[str, str, float]]:
    """Kind, words and what is left [m] of each cause, the most likely first."""
    robot = agreed.robot
    q = data.q[visit]
    x = data.measured[visit]
    seen = data.seen[visit]

    def left(measured: Array, poses: Array) -> Array:
        apart = (measured - agreed.predict(poses))[:, seen]
        return np.asarray(np.sqrt((apart**2).sum(axis=-1).mean(axis=-1)))

    for unit, scale in SCALES.items():
        yield "unit", f"as if in {unit}", float(left(x / scale, q[None])[0])
    slides = np.array([joint.kind == "prismatic" for joint in robot.joints])
    turned = np.where(slides, q, q / DEGREE)
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
    """One joint with another value: the best of a grid that becomes finer."""
    robot = agreed.robot
    for j, joint in enumerate(robot.joints):
        slides = joint.kind == "prismatic"
        low, high = joint.limits if slides else (-np.pi, np.pi)
        best = q[j]
        size = np.inf
        for _ in range(REFINED):
            values = np.linspace(low, high, GRID)
            poses = np.tile(q, (GRID, 1))
            poses[:, j] = values
            errors = left(x, poses)
            best = float(values[errors.argmin()])
            size = float(errors.min())
            low, high = best - (high - low) / 20, best + (high - low) / 20
        off = f"{1e3 * (q[j] - best):.3g} mm" if slides else f"{(q[j] - best) / DEGREE:.3g} deg"
        yield "typed", f"as if {joint.name} were typed wrongly, by {off}", size
