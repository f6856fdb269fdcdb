"""Where the joints and the tool of a chain are, in many poses at once."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from edtk.model.ties import Ties
from edtk.system.typing import Array, Indices, Mask

# The two other components beside each of three, in cyclic order: (a x b)_i = a_j b_k - a_k b_j.
NEXT = np.array([1, 2, 0])
LAST = np.array([2, 0, 1])
# Numbers up to which copies cost less than more calls; measured on one core.
FEW = 20_000


@dataclass(frozen=True, eq=False)
class Frames:
    """The chain in some poses, component first so that every operation runs over contiguous poses.

    Joints that follow others have axes and origins too: of N joints of the chain, n are free. N = n
    where there are no ties.

    Attributes:
        q: Variables (n, ...) of the free joints [rad or m].
        axes: Joint axes in the world frame (N, 3, ...).
        origins: Points on the joint axes (N, 3, ...) [m].
        rotation: The tool frame (3, 3, ...): ``rotation[k]`` is its k-th unit vector (3, ...).
        position: Tool point (3, ...) [m].
        prismatic: Mask (N,) of the prismatic joints.
        bodies: Frames of bodies between the base and the tool, where they were asked for, by the
            index among all joints of the one that moves the body: rotation (3, 3, ...) as above,
            and origin (3, ...) [m].
        ties: How all joints follow the free ones; None where all are free.
    """

    q: Array
    axes: Array
    origins: Array
    rotation: Array
    position: Array
    prismatic: Mask
    bodies: Mapping[int, tuple[Array, Array]] = field(default_factory=dict)
    ties: Ties | None = None

    def __getitem__(self, chosen: Indices) -> "Frames":
        """The chain in some of the poses, chosen along the last axis."""
        by_pose = ("q", "axes", "origins", "rotation", "position")
        arrays = {name: getattr(self, name).take(chosen, axis=-1) for name in by_pose}
        bodies = {
            joint: (rotation.take(chosen, axis=-1), origin.take(chosen, axis=-1))
            for joint, (rotation, origin) in self.bodies.items()
        }
        return replace(self, **arrays, bodies=bodies)

    @property
    def sliding(self) -> Mask:
        """Mask (n,) of the free joints that are prismatic."""
        if self.ties is None:
            return self.prismatic
        return np.asarray(self.prismatic[self.ties.free])

    @cached_property
    def linear(self) -> Array:
        """Velocity of the tool point per free joint (n, 3, ...) [m/rad, or 1 if prismatic]."""
        return self.folded(self.linear_of_each)

    @cached_property
    def angular(self) -> Array:
        """Angular velocity of the tool per free joint (n, 3, ...)."""
        return self.folded(self.angular_of_each)

    @cached_property
    def linear_of_each(self) -> Array:
        """Velocity of the tool point per joint (N, 3, ...) [m/rad, or 1 if prismatic].

        ``a x (p - o)`` for a revolute joint with axis a through o, and ``a`` for a prismatic one.
        """
        J = cross(self.axes, self.position - self.origins)
        if self.prismatic.any():
            J[self.prismatic] = self.axes[self.prismatic]
        return J

    @cached_property
    def angular_of_each(self) -> Array:
        """Angular velocity of the tool per joint (N, 3, ...): ``a``, or zero if prismatic."""
        if not self.prismatic.any():
            return self.axes
        J = self.axes.copy()
        J[self.prismatic] = 0.0
        return J

    def folded(self, by_each: Array) -> Array:
        """Derivatives (n, ...) by the free joints, of those (N, ...) by each joint."""
        return by_each if self.ties is None else self.ties.fold(by_each)

    def folded_sizes(self, by_each: Array) -> Array:
        """Bounds (n, ...) on derivatives by the free joints, of those (N or 1, ...) by each."""
        return by_each if self.ties is None else self.ties.fold_sizes(by_each)

    def spread(self, by_free: Array) -> Array:
        """Values (N, ...) of each joint for those (n, ...) of the free ones, which it follows."""
        return by_free if self.ties is None else self.ties.spread(by_free)


def cross(a: Array, b: Array) -> Array:
    """Cross product of vectors along the second axis (m, 3, ...); the other axes broadcast.

    Of few vectors it is taken in as few calls as possible, of many without copies of the inputs.
    """
    if max(a.size, b.size) < FEW:
        return a.take(NEXT, 1) * b.take(LAST, 1) - a.take(LAST, 1) * b.take(NEXT, 1)
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, (j, k) in enumerate(zip(NEXT, LAST, strict=True)):
        np.multiply(a[:, j], b[:, k], out=out[:, i])
        out[:, i] -= a[:, k] * b[:, j]
    return out
