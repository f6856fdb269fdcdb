"""The range of every drive, and of joints that several drives move."""

from dataclasses import dataclass

import numpy as np

from edtk.robots.constraints.constraint import Constraint, Inequality
from edtk.robots.frames import Frames
from edtk.robots.joint import DEGREE, METRE
from edtk.robots.robot import Bounds, Robot, shown_limits
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class JointLimits(Constraint):
    """Every joint, or its drive where it is coupled to others, stays between its limits.

    Args:
        limits: Lower and upper limits (2, n) [rad or m]; infinite ones, of joints that turn without
            end, are no inequalities.
    """

    limits: Array

    @property
    def _ending(self) -> list[int]:
        """Indices of the joints that have limits."""
        return np.flatnonzero(np.isfinite(self.limits).all(axis=0)).tolist()

    def inequalities(self, robot: Robot) -> tuple[Inequality, ...]:
        """All lower limits of the model, then all upper ones, in the controller's values."""
        units = [METRE if joint.kind == "prismatic" else DEGREE for joint in robot.joints]
        found = []
        limits = shown_limits(robot)
        for side, bounds in zip((1, -1), self.limits, strict=True):
            for j in self._ending:
                limit = limits[j]
                bound = bounds[j]
                unit = units[j]
                sign = ">" if side * limit.sign > 0 else "<"
                value = f"{limit.of(bound) * unit.per_si:g} {unit.name}"
                found.append(Inequality(f"joint limit {limit.label} {sign} {value}", unit))
        return tuple(found)

    def slack(self, frames: Frames) -> Array:
        """``q - lower``, then ``upper - q`` (2n, ...), of the joints that have limits."""
        shape = (-1,) + (1,) * (frames.q.ndim - 1)
        lower, upper = (bound[self._ending].reshape(shape) for bound in self.limits)
        q = frames.q[self._ending]
        return np.concatenate([q - lower, upper - q])

    def gradient(self, frames: Frames) -> Array:
        """Identity, then minus identity (2n, n, ...), rows of the joints that have limits."""
        n = len(frames.q)
        batch = frames.q.shape[1:]
        identity = np.eye(n)[self._ending]
        both = np.concatenate([identity, -identity])
        lifted = both.reshape(*both.shape, *(1,) * len(batch))
        return np.broadcast_to(lifted, (*both.shape, *batch))


@dataclass(frozen=True, eq=False)
class CoupledLimits(Constraint):
    """Every joint that is coupled to others stays between the limits of its own variable.

    That is a sum of coordinates of drives: ``lower <= r q <= upper``.

    Args:
        bounds: The rows r (c, n) and their limits.
    """

    bounds: Bounds

    def inequalities(self, robot: Robot) -> tuple[Inequality, ...]:
        """All lower limits, then all upper ones [deg]."""
        names = self.bounds.names
        return tuple(
            Inequality(f"joint limit {name} {sign} {np.rad2deg(bound):g} deg", DEGREE)
            for sign, bounds in zip("><", self.bounds.limits, strict=True)
            for name, bound in zip(names, bounds, strict=True)
        )

    def slack(self, frames: Frames) -> Array:
        """``r q - lower``, then ``upper - r q`` (2 c, ...)."""
        values = np.tensordot(self.bounds.rows, frames.q, axes=1)
        lower, upper = self.bounds.limits.reshape(2, -1, *(1,) * (values.ndim - 1))
        return np.concatenate([values - lower, upper - values])

    def gradient(self, frames: Frames) -> Array:
        """The rows r, then minus these (2 c, n, ...)."""
        both = np.concatenate([self.bounds.rows, -self.bounds.rows])
        batch = frames.q.shape[1:]
        lifted = both.reshape(*both.shape, *(1,) * len(batch))
        return np.broadcast_to(lifted, (*both.shape, *batch))
