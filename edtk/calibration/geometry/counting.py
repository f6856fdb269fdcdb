"""How a sheet counts the joints, where it is not as the study says."""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from edtk.inference.geometry.linear_start import LinearStart, linear_start
from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.model.robot import Robot
from edtk.system.typing import Array

MOST_POSES = 40  # that a search looks at
MOST_JOINTS = 8  # beyond them the ways to count are too many to try
FAR = 0.02  # of the spread of positions: no drawing is as wrong
MUCH = 4.0  # times better, another way to count is believed
ALIKE = 1.05  # two ways whose distances differ by less are equally good
DEGREE = np.pi / 180


@dataclass(frozen=True, eq=False)
class Counting:
    """How joint variables follow from those of a sheet: ``q = C q_sheet``.

    Attributes:
        matrix: C (n, n): signs on its diagonal, and where a joint follows the one before it.
        words: What is different, for people; empty where nothing is.
    """

    matrix: Array
    words: str = ""

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


def far_off(start: LinearStart, data: MarkerPositions) -> bool:
    """Whether the drawing is so far from the positions that something else is wrong."""
    if not start.whole:
        return False
    spread = float(np.sqrt(((data.measured[data.seen] - _center(data)) ** 2).sum(axis=-1).mean()))
    return start.rms * start.scale > FAR * spread or start.mirrored


def find_counting(robot: Robot, data: MarkerPositions) -> Counting | None:
    """Find signs of the joints, and a joint that follows the one before it, by which all fits.

    A controller may count joints the other way, and that of an arm with a parallelogram may count
    the elbow from the horizontal. Of ways that fit equally well that with the fewest changes
    counts.

    Args:
        robot: The drawing.
        data: Positions with the joint variables of the sheet.

    Returns:
        The way to count; None where none fits much better than that of the study.
    """
    n = robot.n
    if n > MOST_JOINTS:
        return None
    few = _thinned(data)
    still = placed(robot, few)
    best: list[tuple[float, int, Array, str]] = []
    names = robot.joint_names
    moving = np.ptp(few.q, axis=0) > DEGREE / 10
    choices = [(1, -1) if one else (1,) for one in moving]
    for signs in product(*choices):
        for follower, by in [(0, 0), *((j, s) for j in range(1, n) for s in (1, -1))]:
            if follower and not (moving[follower] and moving[follower - 1] and n > 3):
                continue
            matrix = np.diag(np.array(signs, dtype=float))
            if follower:
                matrix[follower] += by * matrix[follower - 1]
            start = placed(robot, few, matrix)
            if start.mirrored or not start.whole:
                continue
            turned = [name for name, sign in zip(names, signs, strict=True) if sign < 0]
            words = _words(turned, names, follower, by)
            best.append((start.rms, len(turned) + 2 * bool(follower), matrix, words))
    if not best:
        return None
    least = min(one[0] for one in best)
    alike = [one for one in best if one[0] <= ALIKE * least + 1e-9]
    _, _, matrix, words = min(alike, key=lambda one: one[1])
    found = placed(robot, few, matrix)
    if not words or far_off(found, few):
        return None
    if still.rms < MUCH * found.rms and not still.mirrored:
        return None
    return Counting(matrix, words)


def in_radians(robot: Robot, data: MarkerPositions) -> bool:
    """Whether the sheet's degrees fit far better as radians."""
    matrix = np.diag(np.where(_slides(robot), 1.0, 1 / DEGREE))
    meant = placed(robot, data, matrix)
    return meant.whole and not far_off(meant, data)


def _slides(robot: Robot) -> Array:
    """Mask (n,) of the prismatic joints."""
    return np.array([joint.kind == "prismatic" for joint in robot.joints])


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
    chosen = np.unique(np.linspace(0, len(data) - 1, MOST_POSES).round().astype(int))
    return data[chosen]


def _center(data: MarkerPositions) -> Array:
    """The mean (3,) of all positions [m]."""
    return np.asarray(data.measured[data.seen].mean(axis=0))
