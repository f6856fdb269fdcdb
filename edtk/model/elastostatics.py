"""The elastostatic model: deflection under load, linear in the joint compliances."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from edtk.model.robot import Frames, Robot, cross

Array = NDArray[np.float64]
Rows = Literal["position", "pose"]


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
        if len(set(unknown)) < len(unknown) or not set(unknown) <= set(range(self.robot.n)) or not unknown:
            raise ValueError(f"unknown joints {unknown} must be distinct indices below {self.robot.n}")
        object.__setattr__(self, "unknown", unknown)

    @property
    def joints(self) -> list[int]:
        """Indices of the joints whose compliances are the parameters."""
        return list(self.unknown or ())

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters: k2 for joint q2, and k_NAME where a joint is not called so."""
        names = (self.robot.joint_names[j] for j in self.joints)
        return tuple(f"k{n[1:]}" if n[:1] == "q" and n[1:].isdigit() else f"k_{n}" for n in names)

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
        """Eq. (4): ``A = [J_1 J_1' W, ..., J_n J_n' W]``, so that the deflection is ``A k`` (Eq. 3, 7).

        Args:
            q: Joint variables (..., n) [rad or m].
            wrench: Forces and torques (..., 6) or (6,) at the tool point in the world frame [N, N m].

        Returns:
            Regressors (..., rows, p) [m/(rad/(N m))], rotation rows in [rad/(rad/(N m))].
        """
        return np.moveaxis(self.regressor_of(self.robot.frames(q), wrench), (0, 1), (-1, -2))

    def regressor_of(self, frames: Frames, wrench: ArrayLike) -> Array:
        """Regressors (p, rows, ...) of poses whose frames are at hand, component first."""
        W = np.moveaxis(np.asarray(wrench, dtype=float), -1, 0)
        F, T = W[:3], W[3:]
        lift = (slice(None),) + (None,) * (frames.position.ndim - F.ndim)
        F, T = F[lift], T[lift]
        linear, angular = frames.linear[self.joints], frames.angular[self.joints]
        linear = _without_rounding(linear, self.robot.reach)
        torque = _dot(linear, F)
        if T.any():
            torque += _dot(angular, T)
        size = self.robot.reach * np.abs(F).sum(axis=0) + np.abs(T).sum(axis=0)
        torque = _without_rounding(torque, size)
        A = linear * torque[:, None]
        return A if self.rows == "position" else np.concatenate([A, angular * torque[:, None]], axis=1)

    def regressor_gradient(self, q: ArrayLike, wrench: ArrayLike) -> Array:
        """Derivative of the regressor with respect to all joint variables.

        ``dA_j/dq_k = dJ_j/dq_k (J_j' W) + J_j (dJ_j/dq_k' W)``, where a revolute joint k at or before j turns
        the column J_j about its axis, and a joint k behind a revolute j moves the tool point:
        ``dJ_j/dq_k = (a_k x v_j, a_k x w_j)`` for k <= j, ``(w_j x v_k, 0)`` for k > j.

        Args:
            q: Joint variables (..., n) [rad or m].
            wrench: Forces and torques (..., 6) or (6,) [N, N m].

        Returns:
            Array (..., rows, p, n).
        """
        return np.moveaxis(self.regressor_gradient_of(self.robot.frames(q), wrench), (2, 0, 1), (-3, -2, -1))

    def regressor_gradient_of(self, frames: Frames, wrench: ArrayLike) -> Array:
        """Derivatives (p, n, rows, ...) of the regressors of poses whose frames are at hand, component first."""
        v, w = frames.linear, frames.angular
        n, batch = self.robot.n, v.shape[2:]
        j, k = (index.ravel() for index in np.meshgrid(self.joints, range(n), indexing="ij"))
        dv = cross(w[np.minimum(j, k)], v[np.maximum(j, k)]).reshape(self.p, n, 3, *batch)
        W = np.moveaxis(np.broadcast_to(np.asarray(wrench, dtype=float), (*batch, 6)), -1, 0)
        F, T = W[:3], W[3:]
        vj, wj = v[self.joints], w[self.joints]
        torque, change = _dot(vj, F), _dot(dv, F, axis=2)
        turned = self.rows == "pose" or bool(T.any())
        if turned:
            dw = cross(w[k], w[j])
            dw[k > j] = 0.0
            dw = dw.reshape(self.p, n, 3, *batch)
            torque, change = torque + _dot(wj, T), change + _dot(dw, T, axis=2)
        dA = dv * torque[:, None, None]
        dA += vj[:, None] * change[:, :, None]
        if self.rows == "position":
            return dA
        return np.concatenate([dA, dw * torque[:, None, None] + wj[:, None] * change[:, :, None]], axis=2)

    def cartesian_stiffness(self, q: ArrayLike, k: ArrayLike) -> Array:
        """Eq. (1): ``K_C = J^-T K_theta J^-1``, as the inverse of ``J k_theta J'`` (any number of joints).

        Args:
            q: Joint variables (..., n).
            k: Compliances (p,) of the unknown joints [rad/(N m)]; the other joints are rigid.

        Returns:
            Array (..., 6, 6) [N/m, N, N m/rad].

        Raises:
            numpy.linalg.LinAlgError: The compliance matrix is singular (fewer than six compliant joints, or a
                singular pose).
        """
        return np.asarray(np.linalg.inv(self.cartesian_compliance(q, k)))

    def cartesian_compliance(self, q: ArrayLike, k: ArrayLike) -> Array:
        """``K_C^-1 = J k_theta J'`` (..., 6, 6) [m/N, 1/N, rad/(N m)], defined in every pose."""
        J = self.robot.jacobian(q)[..., self.joints]
        return (J * np.asarray(k, dtype=float)) @ np.swapaxes(J, -1, -2)

    def deflection(self, q: ArrayLike, wrench: ArrayLike, k: ArrayLike) -> Array:
        """Eq. (2): ``dt = J k_theta J' W``, restricted to the measured rows.

        Args:
            q: Joint variables (..., n).
            wrench: Forces and torques (..., 6) or (6,) [N, N m].
            k: Compliances (p,) [rad/(N m)].

        Returns:
            Deflections (..., rows) [m], rotation rows in [rad].
        """
        t = np.einsum("...ij,...j->...i", self.cartesian_compliance(q, k), np.asarray(wrench, dtype=float))
        return np.asarray(t[..., :3] if self.rows == "position" else t)


def _without_rounding(x: Array, size: ArrayLike) -> Array:
    """X with what is lost in the rounding of numbers of that size set to zero.

    A joint that the load does not turn, or whose axis runs through the tool point, then has an exactly zero
    column; left as rounding noise, it would be scaled up and pass as identified.
    """
    return np.where(np.abs(x) <= 64 * np.finfo(float).eps * np.asarray(size), 0.0, x)


def _dot(a: Array, b: Array, axis: int = 1) -> Array:
    """Sum of products along one short axis of a; b has that axis first."""
    before: tuple[Any, ...] = (slice(None),) * axis
    total = a[(*before, 0)] * b[0]
    for i in range(1, len(b)):
        total += a[(*before, i)] * b[i]
    return total
