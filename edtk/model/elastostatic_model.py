"""The elastostatic model: deflection under load, linear in the joint compliances."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from edtk.model.frames import Frames, cross
from edtk.model.robot import Robot
from edtk.system.typing import Array

Rows = Literal["position", "pose"]
# Rounding of sums and products along a chain of joints, relative to the size of their terms.
ROUNDING = 64 * np.finfo(float).eps


@dataclass(frozen=True, eq=False)
class ElastostaticModel:
    """A robot with compliant joints, loaded and measured at its tool point.

    Args:
        robot: The chain; its tool frame is where the wrench acts and the deflection is measured.
        unknown: Indices (p,) of the joints whose compliances are the parameters; None for all.
        rows: "position" for three measured rows (Eq. 7), "pose" for all six (Eq. 8).

    Raises:
        ValueError: An index is out of range or repeated.
    """

    robot: Robot
    unknown: tuple[int, ...] | None = None
    rows: Rows = "position"

    def __post_init__(self) -> None:
        unknown = tuple(range(self.robot.n)) if self.unknown is None else tuple(self.unknown)
        repeated = len(set(unknown)) < len(unknown)
        in_range = set(unknown) <= set(range(self.robot.n))
        if repeated or not in_range or not unknown:
            raise ValueError(
                f"unknown joints {unknown} must be distinct indices below {self.robot.n}"
            )
        object.__setattr__(self, "unknown", unknown)

    @property
    def joints(self) -> list[int]:
        """Indices of the joints whose compliances are the parameters."""
        return list(self.unknown or ())

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters: k2 for joint q2, and k_NAME for a joint of another name."""
        names = [self.robot.joint_names[j] for j in self.joints]
        numbered = [name[:1] == "q" and name[1:].isdigit() for name in names]
        return tuple(
            f"k{name[1:]}" if number else f"k_{name}"
            for name, number in zip(names, numbered, strict=True)
        )

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the parameters: those of prismatic joints are displacements per force."""
        kinds = (self.robot.joints[j].kind for j in self.joints)
        return tuple("rad/(N m)" if kind == "revolute" else "m/N" for kind in kinds)

    @property
    def unit(self) -> str:
        """The unit of all parameters, or the units where they differ."""
        return " or ".join(sorted(set(self.units), reverse=True))

    @property
    def p(self) -> int:
        """Number of parameters."""
        return len(self.joints)

    def regressor(self, q: ArrayLike, wrench: ArrayLike) -> Array:
        """Eq. (4): ``A = [J_1 J_1' W, ..., J_n J_n' W]``, so that the deflection is ``A k``.

        Args:
            q: Joint variables (..., n) [rad or m].
            wrench: Forces and torques (..., 6) or (6,) at the tool point, in the world frame
                [N, N m].

        Returns:
            Regressors (..., rows, p) of Eq. (3) and (7) [m/(rad/(N m))]; rotation rows in
            [rad/(rad/(N m))].
        """
        return np.moveaxis(self.regressor_of(self.robot.frames(q), wrench), (0, 1), (-1, -2))

    def regressor_of(self, frames: Frames, wrench: ArrayLike) -> Array:
        """Regressors of poses whose frames are at hand, component first.

        Args:
            frames: The poses.
            wrench: Forces and torques (..., 6) or (6,) [N, N m].

        Returns:
            Regressors (p, rows, ...).
        """
        F, T = _force_and_torque(wrench, frames)
        angular = frames.angular[self.joints]
        linear = _without_rounding(frames.linear[self.joints], self.robot.reach)
        torque = _dot(linear, F)
        if T.any():
            torque += _dot(angular, T)
        size = self.robot.reach * np.abs(F).sum(axis=1) + np.abs(T).sum(axis=1)
        torque = _without_rounding(torque, size)
        A = linear * torque[:, None]
        if self.rows == "position":
            return A
        return np.concatenate([A, angular * torque[:, None]], axis=1)

    def regressor_slope(self, q: ArrayLike, wrench: ArrayLike, B: ArrayLike) -> Array:
        """Derivatives of ``<B, A>`` by all joint variables, B held fixed.

        Slopes of criteria need the derivatives of A in no other way. Column j of A is
        ``(v_j, w_j) tau_j`` with ``(v_j, w_j)`` that of the Jacobian and
        ``tau_j = v_j.F + w_j.T``. A revolute joint k at or before j turns both about its axis,
        ``d(v_j, w_j)/dq_k = (w_k x v_j, w_k x w_j)``, and a joint k behind a revolute j moves the
        tool point, ``(w_j x v_k, 0)``. So with ``(b_j, c_j)`` the column of B and
        ``s_j = v_j.b_j + w_j.c_j``,

            d<B, A>/dq_k = w_k . sum_{j >= k} (v_j x f_j + w_j x t_j)
                         + v_k . sum_{j < k} f_j x w_j,
            f_j = tau_j b_j + s_j F,   t_j = tau_j c_j + s_j T.

        Args:
            q: Joint variables (..., n) [rad or m].
            wrench: Forces and torques (..., 6) or (6,) [N, N m].
            B: Weights (..., rows, p) or (rows, p) of the regressor's entries.

        Returns:
            Derivatives (..., n).
        """
        frames = self.robot.frames(q)
        B = np.asarray(B, dtype=float)
        B = np.broadcast_to(B, (*frames.position.shape[1:], *B.shape[-2:]))
        slopes = self.regressor_slope_of(frames, wrench, np.moveaxis(B, (-1, -2), (0, 1)))
        return np.moveaxis(slopes, 0, -1)

    def regressor_slope_of(self, frames: Frames, wrench: ArrayLike, B: Array) -> Array:
        """Slopes of poses whose frames are at hand, component first; see `regressor_slope`.

        Args:
            frames: The poses.
            wrench: Forces and torques (..., 6) or (6,) [N, N m].
            B: Weights (p, rows, ...).

        Returns:
            Derivatives (n, ...).
        """
        v = frames.linear[self.joints]
        w = frames.angular[self.joints]
        F, T = _force_and_torque(wrench, frames)
        tau = _dot(v, F)
        s = _dot(v, B[:, :3])
        # The terms of torques and measured rotations are left out where all of them are zero.
        turned = self.rows == "pose" or bool(T.any())
        if turned:
            tau += _dot(w, T)
        if self.rows == "pose":
            s += _dot(w, B[:, 3:])
        f = tau[:, None] * B[:, :3] + s[:, None] * F
        turning, moving = np.zeros((2, self.robot.n, *f.shape[1:]))
        turning[self.joints] = cross(v, f)
        moving[self.joints] = cross(f, w)
        if turned:
            t = s[:, None] * T
            if self.rows == "pose":
                t = t + tau[:, None] * B[:, 3:]
            turning[self.joints] += cross(w, t)
        at_or_behind = np.cumsum(turning[::-1], axis=0)[::-1]
        before = np.cumsum(moving, axis=0) - moving
        return _dot(frames.angular, at_or_behind) + _dot(frames.linear, before)

    def cartesian_stiffness(self, q: ArrayLike, k: ArrayLike) -> Array:
        """Eq. (1): ``K_C = J^-T K_theta J^-1``, as the inverse of ``J k_theta J'``.

        Args:
            q: Joint variables (..., n) [rad or m], of any number of joints.
            k: Compliances (p,) of the unknown joints [rad/(N m)]; the other joints are rigid.

        Returns:
            Stiffness matrices (..., 6, 6) [N/m, N, N m/rad].

        Raises:
            numpy.linalg.LinAlgError: The compliance matrix is singular (fewer than six compliant
                joints, or a singular pose).
        """
        return np.asarray(np.linalg.inv(self.cartesian_compliance(q, k)))

    def cartesian_compliance(self, q: ArrayLike, k: ArrayLike) -> Array:
        """``K_C^-1 = J k_theta J'``, which is defined in every pose.

        Args:
            q: Joint variables (..., n) [rad or m].
            k: Compliances (p,) of the unknown joints [rad/(N m)].

        Returns:
            Compliance matrices (..., 6, 6) [m/N, 1/N, rad/(N m)].
        """
        J = self.robot.jacobian(q)[..., self.joints]
        return (J * np.asarray(k, dtype=float)) @ np.swapaxes(J, -1, -2)

    def deflection(self, q: ArrayLike, wrench: ArrayLike, k: ArrayLike) -> Array:
        """Eq. (2): ``dt = J k_theta J' W``, restricted to the measured rows.

        Args:
            q: Joint variables (..., n) [rad or m].
            wrench: Forces and torques (..., 6) or (6,) [N, N m].
            k: Compliances (p,) [rad/(N m)].

        Returns:
            Deflections (..., rows) [m], rotation rows in [rad].
        """
        W = np.asarray(wrench, dtype=float)
        t = np.einsum("...ij,...j->...i", self.cartesian_compliance(q, k), W)
        return np.asarray(t[..., :3] if self.rows == "position" else t)


def _without_rounding(x: Array, size: ArrayLike) -> Array:
    """Numbers x, of which those that are the rounding of numbers of that size are set to zero.

    A joint that the load does not turn, or whose axis runs through the tool point, then has an
    exactly zero column; left as rounding noise, it would be scaled up and pass as identified.
    """
    return np.where(np.abs(x) <= ROUNDING * np.asarray(size), 0.0, x)


def _force_and_torque(wrench: ArrayLike, frames: Frames) -> tuple[Array, Array]:
    """Force and torque (1, 3, ...), component first, aligned with the last axes of the frames."""
    W = np.asarray(wrench, dtype=float)
    W = W.transpose(-1, *range(W.ndim - 1))
    W = W[(slice(None),) + (None,) * (frames.position.ndim - W.ndim)]
    return W[None, :3], W[None, 3:]


def _dot(a: Array, b: Array) -> Array:
    """Sums of products (n, ...) along the second axis of a and b, (n, c, ...) or (1, c, ...)."""
    return np.asarray(np.einsum("nc...,nc...->n...", a, b))
