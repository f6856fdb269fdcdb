"""A distance from poses that must not be used."""

from dataclasses import dataclass

import numpy as np

from edtk.robots.constraints.constraint import Constraint, Inequality
from edtk.robots.frames import Frames
from edtk.robots.joint import DEGREE
from edtk.robots.robot import Robot
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class Excluded(Constraint):
    """The joint angles keep a distance from each of some poses that must not be used.

    The distance is Euclidean, over the revolute joints, each difference taken the short way round.

    Args:
        poses: Poses to stay away from (c, n) [rad]; entries of prismatic joints do not count.
        distance: Least distance [rad].
    """

    poses: Array
    distance: float

    def inequalities(self, robot: Robot) -> tuple[Inequality, ...]:
        """One bound a pose [deg]."""
        bound = np.rad2deg(self.distance)
        return tuple(
            Inequality(f"distance from excluded pose {i + 1} > {bound:g} deg", DEGREE)
            for i in range(len(self.poses))
        )

    def slack(self, frames: Frames) -> Array:
        """``|q - q_i| - distance`` (c, ...)."""
        _, length = self._away(frames)
        return length - self.distance

    def gradient(self, frames: Frames) -> Array:
        """``(q - q_i) / |q - q_i|`` (c, n, ...).

        At the pose itself it is not defined, and zero is returned.
        """
        difference, length = self._away(frames)
        return difference / np.maximum(length, np.finfo(float).tiny)[:, None]

    def _away(self, frames: Frames) -> tuple[Array, Array]:
        """Differences (c, n, ...) to the poses, and their lengths (c, ...) [rad]."""
        lift = (...,) + (None,) * (frames.q.ndim - 1)
        turn = frames.q - self.poses[lift]
        short_way = np.mod(turn + np.pi, 2 * np.pi) - np.pi
        difference = np.where(frames.sliding[lift], 0.0, short_way)
        return difference, np.sqrt(np.square(difference).sum(axis=1))
