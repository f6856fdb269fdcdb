"""The ways to count that are told apart: signs, and a joint that follows another one."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from edtk.inference.controller_search.same_arms import SameArm
from edtk.model.controller import Follows
from edtk.model.robot import Robot
from edtk.system.typing import Array

PARALLEL = 1e-6  # sine of the angle between axes that count as parallel
FACTORS = (1.0, -1.0)


@dataclass(frozen=True, eq=False)
class WayToCount:
    """Signs of all joints, and perhaps a coupling.

    Attributes:
        sign: 1 or -1 (n,).
        follows: The coupling, if there is one.
    """

    sign: Array
    follows: Follows | None

    @property
    def counting(self) -> Array:
        """The matrix L (n, n) of ``q = L c + o``."""
        n = len(self.sign)
        coupling = np.eye(n)
        if self.follows is not None:
            coupling[self.follows.joint, self.follows.leader] = self.follows.factor
        return np.asarray(self.sign[:, None] * coupling)


def ways_to_count(
    robot: Robot, same: tuple[SameArm, ...], moving: list[int]
) -> tuple[WayToCount, ...]:
    """List all signs and couplings, of those that make the same arm only one.

    Of a joint that stands still nothing can be told: its sign stays 1.

    A joint may follow one before it whose axis is parallel, with parallel axes in between: that is
    where a parallelogram, or the habit of counting against the floor, is found.
    """
    signs: list[Array] = []
    seen: set[tuple[float, ...]] = set()
    by_turned = sorted(product((1.0, -1.0), repeat=robot.n), key=lambda sign: sign.count(-1.0))
    for sign in map(np.array, by_turned):
        still = np.delete(sign, moving)
        if (still > 0).all() and tuple(sign) not in seen:
            signs.append(sign)
            seen |= {_moved(sign * one.sign, moving) for one in same}
    couplings = [one for one in _couplings(robot) if {one.joint, one.leader} <= set(moving)]
    return tuple(WayToCount(sign, follows) for follows in (None, *couplings) for sign in signs)


def _moved(sign: Array, moving: list[int]) -> tuple[float, ...]:
    """Signs with 1 for joints that stand still."""
    return tuple(one if j in moving else 1.0 for j, one in enumerate(sign.tolist()))


def _couplings(robot: Robot) -> list[Follows]:
    """Joints that may follow one before them."""
    frames = robot.frames(np.zeros(robot.n))
    axes = frames.axes if frames.ties is None else frames.axes[frames.ties.free]
    turns = [joint.kind != "prismatic" for joint in robot.joints]
    found = []
    for j in range(1, robot.n):
        for leader in reversed(range(j)):
            if not (turns[j] and turns[leader]):
                break
            if np.linalg.norm(np.cross(axes[leader], axes[leader + 1])) > PARALLEL:
                break
            found += [Follows(j, leader, factor) for factor in FACTORS]
    return found
