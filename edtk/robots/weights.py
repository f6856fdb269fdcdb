"""What loads the joints of a chain besides a wrench: weights of its bodies, and compensators."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from edtk.robots.compensator import Pull
from edtk.robots.frames import WRENCH, BodyPoint, Frames, cross, dot
from edtk.system.typing import Array

GRAVITY = 9.80665  # standard acceleration [m/s^2], along -z of the world


@dataclass(frozen=True, eq=False)
class DeadWeights:
    """Masses on the bodies of a chain, and the compensators that carry them.

    The bodies behind joint j have the mass m_j together, and their common centre of mass c_j turns
    with the joint as one. So the weights load the joint by ``tau_j = v_j . m_j g``, with the
    velocity v_j of c_j per joint j: one cross product a joint, whatever the number of bodies.

    Args:
        masses: Masses (w,) [kg].
        centers: Their centres of mass (w,), points of the bodies.
        joints: Number n of joints, those that follow others included.
        pulls: Compensators across joints, see `Pull`.
    """

    masses: tuple[float, ...]
    centers: tuple[BodyPoint, ...]
    joints: int
    pulls: tuple[Pull, ...] = ()

    def with_more(self, other: "DeadWeights") -> "DeadWeights":
        """These weights and others on the same chain."""
        masses = (*self.masses, *other.masses)
        centers = (*self.centers, *other.centers)
        return DeadWeights(masses, centers, self.joints, (*self.pulls, *other.pulls))

    @property
    def bodies(self) -> tuple[int, ...]:
        """Joints whose bodies' frames are needed, see `Robot.frames`."""
        return tuple(sorted({joint for center in self.centers for joint in center.bodies}))

    @cached_property
    def _behind(self) -> Array:
        """Whether joint j carries mass i (n, w)."""
        bodies = [self.joints if c.joint is None else c.joint for c in self.centers]
        return (np.arange(self.joints)[:, None] <= np.array(bodies)).astype(float)

    @cached_property
    def carried(self) -> Array:
        """Mass (n,) behind each joint [kg]."""
        return np.asarray(self._behind @ np.array(self.masses))

    def force(self, frames: Frames) -> Array:
        """The weight (n, 3, ...) behind each joint, of unit axes after the second [N]."""
        down = np.zeros((self.joints, 3))
        down[:, 2] = -GRAVITY * self.carried
        return down.reshape(*down.shape, *[1] * (frames.position.ndim - 1))

    def linear(self, frames: Frames) -> Array:
        """Velocity (n, 3, ...) per joint of the centre of mass of all that is behind it."""
        if not self.masses:
            return np.zeros_like(frames.axes)
        points = np.stack([center.position(frames) for center in self.centers])
        share = self._behind * np.array(self.masses)
        # A joint that carries nothing has no centre of mass; its weight is zero anyway.
        share /= np.where(self.carried > 0, self.carried, 1.0)[:, None]
        common = np.einsum("jw,wc...->jc...", share, points)
        J = cross(frames.axes, common - frames.origins)
        J[frames.prismatic] = frames.axes[frames.prismatic]
        return J

    def torque(self, frames: Frames) -> Array:
        """Joint loads (n, ...) [N m, or N if prismatic]."""
        torque = dot(self.linear(frames), self.force(frames))
        for pull in self.pulls:
            torque[pull.places] += pull.loads(frames.variables(pull.places))
        return torque

    def torque_derivative(self, frames: Frames) -> Array:
        """``dtau_j/dq_k`` (n, n, ...), symmetric as the Hessian of a potential."""
        bent = cross(self.linear(frames), self.force(frames))
        H = np.einsum("kc...,jc...->jk...", frames.angular_of_each, bent)
        n = self.joints
        later = np.triu_indices(n, 1)
        H[later] = H[later[::-1]]
        for pull in self.pulls:
            H[np.ix_(pull.places, pull.places)] += pull.load_derivative(
                frames.variables(pull.places)
            )
        return H

    def torque_slope(self, frames: Frames, s: Array) -> Array:
        """Derivatives (n, ...) of ``sum_j s_j tau_j`` by all joints, weights s (n, ...) held fixed.

        A joint k at or before j turns all that is behind j, and a joint k behind j moves what is
        behind k only: ``dtau_j/dq_k = w_k.(v_j x F_j)`` for k <= j, else ``w_j.(v_k x F_k)``.
        """
        bent = cross(self.linear(frames), self.force(frames))
        turning = s[:, None] * bent
        at_or_behind = np.cumsum(turning[::-1], axis=0)[::-1]
        spun = s[:, None] * frames.angular_of_each
        before = np.cumsum(spun, axis=0) - spun
        slope = dot(frames.angular_of_each, at_or_behind) + dot(before, bent)
        for pull in self.pulls:
            changed = pull.load_derivative(frames.variables(pull.places))
            slope[pull.places] += np.einsum("j...,jk...->k...", s[pull.places], changed)
        return slope


# Weights with the share (m,) of them that acts in each pose.
Counted = tuple[DeadWeights, Array | float]


@dataclass(frozen=True, eq=False)
class Loading:
    """Where a wrench acts, and what else loads the joints.

    Attributes:
        point: Where the wrench acts; the tool point by default.
        weights: Weights that hang on the arm; None for none.
    """

    point: BodyPoint = field(default_factory=BodyPoint)
    weights: DeadWeights | None = None

    @property
    def bodies(self) -> tuple[int, ...]:
        """Joints whose bodies' frames are needed, see `Robot.frames`."""
        return (*self.point.bodies, *(self.weights.bodies if self.weights else ()))

    @property
    def counted(self) -> tuple[Counted, ...]:
        """The weights, all of which act in each pose."""
        return () if self.weights is None else ((self.weights, 1.0),)


def torque_derivative(frames: Frames, point: BodyPoint, wrench: Array, *weights: Counted) -> Array:
    """Derivatives ``H_jl = dtau_j/dq_l`` (m, n, n) of the free joints' loads.

    ``dJ_j/dq_l = (w_l x v_j, w_l x w_j)`` for l <= j and ``(w_j x v_l, 0)`` for l > j, with the
    linear and angular columns v and w of the Jacobian.

    Args:
        frames: The chain in m poses, with all bodies that are loaded.
        point: Where the wrench acts.
        wrench: Forces and torques (m, 6 or 9) [N, N m].
        weights: What else loads the joints, with how much of it (m,) does in each pose.
    """
    acting = point.of_load(wrench)
    v = acting.linear(frames)
    w = acting.angular(frames)
    F = wrench[:, :3].T
    T = wrench[:, 3:WRENCH].T
    # (w_l x v_j).F = w_l.(v_j x F): n cross products, and a dot product for each pair.
    forced = np.einsum("lcN,jcN->Njl", w, cross(v, F[None]))
    H = np.tril(forced)
    H += np.swapaxes(np.tril(forced, -1), -1, -2)
    if T.any():
        H += np.tril(np.einsum("lcN,jcN->Njl", w, cross(w, T[None])))
    for one, share in weights:
        H += np.moveaxis(one.torque_derivative(frames) * share, -1, 0)
    return H if frames.ties is None else frames.ties.matrix.T @ H @ frames.ties.matrix
