"""The feasible set of poses: small constraint objects with values and gradients, and their intersection."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from edtk.model.robot import Frames, Robot, cross

Array = NDArray[np.float64]


class Constraint(ABC):
    """One or more inequalities ``slack >= 0`` on a pose; arrays are component first, as in `Frames`."""

    @abstractmethod
    def labels(self, robot: Robot) -> tuple[str, ...]:
        """What a person calls each inequality (c,): name, sign, bound, and its unit as the last word."""

    @abstractmethod
    def slack(self, frames: Frames) -> Array:
        """Distance to each bound (c, ...) [m or rad], positive inside."""

    @abstractmethod
    def gradient(self, frames: Frames) -> Array:
        """Derivative (c, n, ...) of the slack with respect to the joint variables."""


@dataclass(frozen=True)
class Height(Constraint):
    """The tool point stays above a height [m] (Table 3, p_z)."""

    minimum: float

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """One label."""
        return (f"height p_z > {1e3 * self.minimum:g} mm",)

    def slack(self, frames: Frames) -> Array:
        """``p_z - minimum`` (1, ...)."""
        return frames.position[2:3] - self.minimum

    def gradient(self, frames: Frames) -> Array:
        """The vertical row of the Jacobian (1, n, ...)."""
        return frames.linear[None, :, 2]


@dataclass(frozen=True)
class Radius(Constraint):
    """The tool point stays outside a vertical cylinder around the base axis [m] (Table 3, r)."""

    minimum: float

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """One label."""
        return (f"radius r > {1e3 * self.minimum:g} mm",)

    def slack(self, frames: Frames) -> Array:
        """``hypot(p_x, p_y) - minimum`` (1, ...)."""
        return np.hypot(frames.position[0], frames.position[1])[None] - self.minimum

    def gradient(self, frames: Frames) -> Array:
        """``(p_x v_x + p_y v_y) / r`` (1, n, ...); zero on the axis itself, where it is not defined."""
        x, y = frames.position[0], frames.position[1]
        r = np.maximum(np.hypot(x, y), np.finfo(float).tiny)
        return ((x * frames.linear[:, 0] + y * frames.linear[:, 1]) / r)[None]


@dataclass(frozen=True)
class Tilt(Constraint):
    """The tool frame's z-axis stays within an angle [rad] of the horizontal plane (Table 3, phi).

    ``phi = asin(z_tool . e_z)`` is bounded on both sides, as two inequalities that are smooth at phi = 0.
    """

    maximum: float

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """Upper and lower side."""
        bound = np.rad2deg(self.maximum)
        return (f"tilt phi < {bound:g} deg", f"tilt phi > {-bound:g} deg")

    def slack(self, frames: Frames) -> Array:
        """``maximum - phi`` and ``maximum + phi`` (2, ...)."""
        phi = np.arcsin(np.clip(frames.rotation[2, 2], -1.0, 1.0))
        return np.stack([self.maximum - phi, self.maximum + phi])

    def gradient(self, frames: Frames) -> Array:
        """``dphi/dq_k = (w_k x z)_z / cos(phi)`` with both signs (2, n, ...); bounded at the poles."""
        z = frames.rotation[2]
        cos = np.maximum(np.hypot(z[0], z[1]), 1e-12)
        dphi = cross(frames.angular, z[None])[:, 2] / cos
        return np.stack([-dphi, dphi])


@dataclass(frozen=True, eq=False)
class Excluded(Constraint):
    """The joint angles keep a distance from each of some poses that must not be used.

    The distance is Euclidean, over the revolute joints, each difference taken the short way round.

    Args:
        poses: Poses to stay away from (c, n) [rad; entries of prismatic joints do not count].
        distance: Least distance [rad].
    """

    poses: Array
    distance: float

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """One label a pose."""
        bound = np.rad2deg(self.distance)
        return tuple(
            f"distance from excluded pose {i + 1} > {bound:g} deg" for i in range(len(self.poses))
        )

    def _away(self, frames: Frames) -> tuple[Array, Array]:
        """Differences (c, n, ...) to the poses, and their lengths (c, ...)."""
        lift = (...,) + (None,) * (frames.q.ndim - 1)
        d = frames.q - self.poses[lift]
        d = np.where(frames.prismatic[lift], 0.0, np.mod(d + np.pi, 2 * np.pi) - np.pi)
        return d, np.sqrt(np.square(d).sum(axis=1))

    def slack(self, frames: Frames) -> Array:
        """``|q - q_i| - distance`` (c, ...)."""
        return self._away(frames)[1] - self.distance

    def gradient(self, frames: Frames) -> Array:
        """``(q - q_i) / |q - q_i|`` (c, n, ...); zero at the pose itself, where it is not defined."""
        d, length = self._away(frames)
        return d / np.maximum(length, np.finfo(float).tiny)[:, None]


@dataclass(frozen=True)
class JointLimits(Constraint):
    """Every joint stays between its limits, (2, n) [rad or m]."""

    limits: Array

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """All lower limits, then all upper ones."""
        unit = [(1.0, "m") if j.kind == "prismatic" else (180 / np.pi, "deg") for j in robot.joints]
        return tuple(
            f"joint limit {name} {sign} {bound * factor:g} {u}"
            for sign, bounds in zip((">", "<"), self.limits, strict=True)
            for name, bound, (factor, u) in zip(robot.joint_names, bounds, unit, strict=True)
        )

    def slack(self, frames: Frames) -> Array:
        """``q - lower``, then ``upper - q`` (2n, ...)."""
        shape = (-1,) + (1,) * (frames.q.ndim - 1)
        lower, upper = (bound.reshape(shape) for bound in self.limits)
        return np.concatenate([frames.q - lower, upper - frames.q])

    def gradient(self, frames: Frames) -> Array:
        """Identity, then minus identity (2n, n, ...)."""
        eye = np.eye(len(frames.q))
        G = np.concatenate([eye, -eye]).reshape(2 * len(eye), len(eye), *(1,) * (frames.q.ndim - 1))
        return np.broadcast_to(G, (*G.shape[:2], *frames.q.shape[1:]))


@dataclass(frozen=True, eq=False)
class Workspace:
    """The intersection of constraints, for one robot; batch first for callers.

    Args:
        robot: The chain whose tool point and frame are constrained.
        constraints: Any number of constraints besides the robot's joint limits, which always hold.
    """

    robot: Robot
    constraints: tuple[Constraint, ...] = ()

    @property
    def everything(self) -> tuple[Constraint, ...]:
        """The given constraints, and the joint limits."""
        return (*self.constraints, JointLimits(self.robot.limits))

    @property
    def labels(self) -> tuple[str, ...]:
        """What a person calls each inequality (c,)."""
        return tuple(label for c in self.everything for label in c.labels(self.robot))

    def violations(self, slack: Array, tolerance: float = 1e-9) -> list[str]:
        """What a person reads of the slacks (c,) of one pose that are below -tolerance, with the amount."""
        factors = {"mm": 1e3, "deg": 180 / np.pi, "m": 1.0}
        return [
            f"'{label}' by {-value * factors[unit]:.3g} {unit}"
            for label, value in zip(self.labels, slack, strict=True)
            if value < -tolerance
            for unit in (label.split()[-1],)
        ]

    def slack(self, q: ArrayLike) -> Array:
        """All slacks (..., c) of the poses q (..., n) [m or rad]; feasible where none is negative."""
        frames = self.robot.frames(q)
        return np.moveaxis(np.concatenate([c.slack(frames) for c in self.everything]), 0, -1)

    def gradient(self, q: ArrayLike) -> Array:
        """Derivative (..., c, n) of the slacks with respect to the joint variables."""
        frames = self.robot.frames(q)
        G = np.concatenate([c.gradient(frames) for c in self.everything])
        return np.moveaxis(G, (0, 1), (-2, -1))

    def contains(self, q: ArrayLike) -> NDArray[np.bool_]:
        """Whether each pose (..., n) satisfies every constraint."""
        return np.asarray((self.slack(q) >= 0).all(axis=-1))

    def slack_within(self, q: ArrayLike, resolution: ArrayLike) -> Array:
        """Slacks (..., c) at the best pose within rounding, to first order.

        A pose that was rounded to `resolution`, one number or one per joint (n,) [rad or m], may have been
        feasible before: each slack is raised by ``sum_k |d slack/dq_k| resolution_k/2``, the most that rounding
        can have taken from it.
        """
        return self.slack(q) + (np.abs(self.gradient(q)) * np.asarray(resolution) / 2).sum(axis=-1)
