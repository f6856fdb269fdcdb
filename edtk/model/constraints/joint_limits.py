"""The range of every joint."""

from dataclasses import dataclass

import numpy as np

from edtk.model.constraints.constraint import Constraint, Inequality
from edtk.model.frames import Frames
from edtk.model.robot import Robot
from edtk.model.shown_limit import shown_limits
from edtk.model.unit import DEGREE, METRE
from edtk.system.typing import Array


@dataclass(frozen=True)
class JointLimits(Constraint):
    """Every joint stays between its limits, (2, n) [rad or m]."""

    limits: Array

    def inequalities(self, robot: Robot) -> tuple[Inequality, ...]:
        """All lower limits of the model, then all upper ones, in the controller's values."""
        units = [METRE if joint.kind == "prismatic" else DEGREE for joint in robot.joints]
        found = []
        for side, bounds in zip((1, -1), self.limits, strict=True):
            for limit, bound, unit in zip(shown_limits(robot), bounds, units, strict=True):
                sign = ">" if side * limit.sign > 0 else "<"
                value = f"{limit.of(bound) * unit.per_si:g} {unit.name}"
                found.append(Inequality(f"joint limit {limit.label} {sign} {value}", unit))
        return tuple(found)

    def slack(self, frames: Frames) -> Array:
        """``q - lower``, then ``upper - q`` (2n, ...)."""
        shape = (-1,) + (1,) * (frames.q.ndim - 1)
        lower, upper = (bound.reshape(shape) for bound in self.limits)
        return np.concatenate([frames.q - lower, upper - frames.q])

    def gradient(self, frames: Frames) -> Array:
        """Identity, then minus identity (2n, n, ...)."""
        n = len(frames.q)
        batch = frames.q.shape[1:]
        both = np.concatenate([np.eye(n), -np.eye(n)])
        lifted = both.reshape(2 * n, n, *(1,) * len(batch))
        return np.broadcast_to(lifted, (2 * n, n, *batch))
