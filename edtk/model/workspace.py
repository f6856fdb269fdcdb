"""The feasible set of poses: the intersection of constraints."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from edtk.model.constraints.constraint import Constraint, Inequality
from edtk.model.constraints.joint_limits import JointLimits
from edtk.model.robot import Robot
from edtk.system.typing import Array, Mask


@dataclass(frozen=True)
class Violation:
    """An inequality that a pose breaks.

    Attributes:
        inequality: Its name and unit.
        amount: By how much it is broken [m or rad], positive.
    """

    inequality: Inequality
    amount: float

    def __str__(self) -> str:
        unit = self.inequality.unit
        return f"'{self.inequality.label}' by {self.amount * unit.per_si:.3g} {unit.name}"


@dataclass(frozen=True, eq=False)
class Workspace:
    """The intersection of constraints, for one robot; batch first for callers.

    Args:
        robot: The chain whose tool point and frame are constrained.
        constraints: Constraints besides the robot's joint limits, which always hold.
    """

    robot: Robot
    constraints: tuple[Constraint, ...] = ()

    @property
    def everything(self) -> tuple[Constraint, ...]:
        """The given constraints, and the joint limits."""
        return (*self.constraints, JointLimits(self.robot.hard_limits))

    @property
    def inequalities(self) -> tuple[Inequality, ...]:
        """Name and unit of each inequality (c,)."""
        return tuple(
            inequality
            for constraint in self.everything
            for inequality in constraint.inequalities(self.robot)
        )

    @property
    def labels(self) -> tuple[str, ...]:
        """Name of each inequality (c,)."""
        return tuple(inequality.label for inequality in self.inequalities)

    def violations(self, slack: Array, tolerance: float = 1e-9) -> tuple[Violation, ...]:
        """Inequalities that one pose breaks.

        Args:
            slack: Slacks (c,) of the pose [m or rad].
            tolerance: Slacks down to minus this count as rounding [m or rad].
        """
        return tuple(
            Violation(inequality, -float(value))
            for inequality, value in zip(self.inequalities, slack, strict=True)
            if value < -tolerance
        )

    def slack(self, q: ArrayLike) -> Array:
        """All slacks (..., c) of the poses q (..., n) [m or rad]; negative ones are violations."""
        frames = self.robot.frames(q)
        slacks = [constraint.slack(frames) for constraint in self.everything]
        return np.moveaxis(np.concatenate(slacks), 0, -1)

    def gradient(self, q: ArrayLike) -> Array:
        """Derivative (..., c, n) of the slacks with respect to the joint variables."""
        frames = self.robot.frames(q)
        gradients = [constraint.gradient(frames) for constraint in self.everything]
        return np.moveaxis(np.concatenate(gradients), (0, 1), (-2, -1))

    def contains(self, q: ArrayLike) -> Mask:
        """Whether each pose (..., n) satisfies every constraint."""
        return np.asarray((self.slack(q) >= 0).all(axis=-1))

    def slack_within(self, q: ArrayLike, resolution: ArrayLike) -> Array:
        """Slacks (..., c) at the best pose within rounding, to first order.

        A pose that was rounded to `resolution` may have been feasible before: each slack is raised
        by ``sum_k |d slack/dq_k| resolution_k/2``, the most that rounding can have taken from it.

        Args:
            q: Joint variables (..., n), rounded [rad or m].
            resolution: Step of the rounding, one number or one a joint (n,) [rad or m].
        """
        return self.slack(q) + (np.abs(self.gradient(q)) * np.asarray(resolution) / 2).sum(axis=-1)
