"""Where joints, bodies and the tool of a chain are in many poses at once, and how they move."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from edtk.robots.joint import Ties
from edtk.system.typing import Array, Indices, Mask

MM = 1e3  # [mm/m]: the house reckons in metres, and people read millimetres
MILLIMETRE = 1e-3  # [m]

# Numbers up to which copies cost less than more calls; measured on one core.
FEW = 20_000
# Entries of a constant rotation that are this close to zero are the rounding of a right angle.
RIGHT_ANGLE = 1e-15


# The two other components beside each of three, in cyclic order: (a x b)_i = a_j b_k - a_k b_j.
NEXT = np.array([1, 2, 0])
LAST = np.array([2, 0, 1])


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

    @cached_property
    def flat(self) -> "Frames":
        """The same poses along one axis; no reference to these frames."""
        batch = self.position.ndim - 1
        count = self.position[0].size

        def flat(A: Array) -> Array:
            return A.reshape(*A.shape[: A.ndim - batch], count)

        return replace(
            self,
            q=flat(self.q),
            axes=flat(self.axes),
            origins=flat(self.origins),
            rotation=flat(self.rotation),
            position=flat(self.position),
            bodies={joint: (flat(R), flat(p)) for joint, (R, p) in self.bodies.items()},
        )

    def shifted(self, place: int, shift: Array) -> "Frames":
        """The chain from a joint on, moved without a turn: the link before that joint is another.

        Args:
            place: Index of the joint among all of the chain; their number for the tool alone.
            shift: By how much it moves in the world (3, ...) [m].
        """
        origins = self.origins.copy()
        origins[place:] += shift
        bodies = {
            joint: (rotation, origin + shift if joint >= place else origin)
            for joint, (rotation, origin) in self.bodies.items()
        }
        return replace(self, origins=origins, position=self.position + shift, bodies=bodies)

    def variables(self, joints: list[int]) -> Array:
        """Variables (k, ...) of joints, by their indices among all of the chain [rad or m]."""
        q = self.q if self.ties is None else self.ties.variables(self.q)
        return np.asarray(q[joints])

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


WRENCH = 6  # components of a force and its torque
Terms = tuple[tuple[int, float], ...]  # numbers of columns, and the weights that are not zero


def combine(columns: Sequence[Array], weights: Array) -> Array | float:
    """Linear combination of frame columns (3, ...) with constant weights (3,), zeros skipped."""
    terms = terms_of(weights)
    return 0.0 + combine_terms(columns, terms) if terms else 0.0


def terms_of(weights: Array) -> Terms:
    """What of constant weights (3,) counts in a linear combination."""
    return tuple((k, float(w)) for k, w in enumerate(weights) if abs(w) > RIGHT_ANGLE)


def combine_terms(columns: Sequence[Array], terms: Terms) -> Array:
    """Linear combination of frame columns (3, ...), of one term at least.

    A single column of weight one is returned as it is, and not as a copy.
    """
    total: Array | None = None
    for k, weight in terms:
        term = columns[k] if weight == 1.0 else weight * columns[k]
        total = term if total is None else total + term
    assert total is not None
    return total


def columns_slope(linear: Array, angular: Array, f: Array, t: Array | None = None) -> Array:
    """Derivatives of ``sum_j v_j.f_j + w_j.t_j`` by all joint variables, f and t held fixed.

    ``(v_j, w_j)`` are the columns of the Jacobian of one point. A joint k at or before j turns both
    about its axis if it is revolute, ``d(v_j, w_j)/dq_k = (w_k x v_j, w_k x w_j)``, and a joint k
    behind a revolute j moves the point, ``(w_j x v_k, 0)``. So

        d/dq_k = w_k . sum_{j >= k} (v_j x f_j + w_j x t_j) + v_k . sum_{j < k} f_j x w_j.

    Args:
        linear: Columns v (n, 3, ...), zero for joints that do not move the point.
        angular: Columns w (n, 3, ...), zero for these too.
        f: Weights (n, 3, ...) of v.
        t: Weights (n, 3, ...) of w; None for zero.

    Returns:
        Derivatives (n, ...).
    """
    turning = cross(linear, f)
    if t is not None:
        turning += cross(angular, t)
    return summed_slope(linear, angular, turning, cross(f, angular))


def summed_slope(linear: Array, angular: Array, turning: Array, moving: Array) -> Array:
    """``w_k . sum_{j >= k} turning_j + v_k . sum_{j < k} moving_j`` (n, ...), for each joint k.

    Sums are added up in place, a joint at a time: over the first of several axes numpy's own
    cumulative sums take twice as long.

    Args:
        linear: Columns v (n, 3, ...).
        angular: Columns w (n, 3, ...).
        turning: Terms (n, 3, ...), which are overwritten.
        moving: Terms (n, 3, ...), likewise.
    """
    last = len(turning) - 1
    for k in range(last, 0, -1):
        turning[k - 1] += turning[k]
    for k in range(1, last):
        moving[k] += moving[k - 1]
    slope = dot(angular, turning)
    slope[1:] += dot(linear[1:], moving[:last])
    return slope


def dot(a: Array, b: Array) -> Array:
    """Sums of products (n, ...) along the second axis of a and b, (n, c, ...) or (1, c, ...)."""
    return np.asarray(np.einsum("nc...,nc...->n...", a, b))


@dataclass(frozen=True, eq=False)
class BodyPoint:
    """A point of the tool, or of the body that a joint moves.

    Attributes:
        offset: Offset (3,) from the tool point in the tool frame, or in the joint's frame [m]; for
            a point that is elsewhere in each pose, one a pose (3, ...).
        joint: Index of the joint that moves the body, among all joints of the chain; None for the
            tool.
    """

    offset: Array = field(default_factory=lambda: np.zeros(3))
    joint: int | None = None

    @property
    def is_tool_point(self) -> bool:
        """Whether the point is the tool point itself."""
        return self.joint is None and not np.any(self.offset)

    @property
    def bodies(self) -> tuple[int, ...]:
        """Joints whose bodies' frames the point needs, see `Robot.frames`."""
        return () if self.joint is None else (self.joint,)

    def of_load(self, wrench: ArrayLike) -> "BodyPoint":
        """The point at which loads act, where this is the study's load point.

        Args:
            wrench: Forces and torques (..., 6) at this point [N, N m]; or (..., 9), which end with
                how far from it, in the frame of its body, each load acts [m].
        """
        W = np.asarray(wrench, dtype=float)
        if W.shape[-1] == WRENCH:
            return self
        levers = np.moveaxis(W[..., WRENCH:], -1, 0)
        offset = self.offset.reshape(3, *[1] * (levers.ndim - 1))
        return BodyPoint(offset + levers, self.joint)

    def position(self, frames: Frames) -> Array:
        """Position (3, ...) in the world [m]."""
        if self.joint is None:
            return frames.position + self._lever(frames.rotation)
        rotation, origin = frames.bodies[self.joint]
        return origin + self._lever(rotation)

    def orientation(self, frames: Frames) -> Array:
        """The frame of the body (3, 3, ...): its k-th unit vector is the k-th entry."""
        return frames.rotation if self.joint is None else frames.bodies[self.joint][0]

    def linear(self, frames: Frames) -> Array:
        """Velocity of the point per joint (N, 3, ...) [m/rad, or 1 if prismatic].

        ``a x (p - o)`` for a revolute joint with axis a through o, ``a`` for a prismatic one, and
        zero for joints behind the body.
        """
        if self.is_tool_point:
            return frames.linear_of_each
        J = cross(frames.axes, self.position(frames) - frames.origins)
        J[frames.prismatic] = frames.axes[frames.prismatic]
        if self.joint is not None:
            J[self.joint + 1 :] = 0.0
        return J

    def angular(self, frames: Frames) -> Array:
        """Angular velocity of the body per joint (N, 3, ...), zero for joints behind it."""
        if self.joint is None:
            return frames.angular_of_each
        J = frames.angular_of_each.copy()
        J[self.joint + 1 :] = 0.0
        return J

    def _lever(self, rotation: Array) -> Array:
        """The offset (3, ...) in world axes [m]."""
        return np.einsum("k...,kc...->c...", self.offset, rotation)


def force_and_torque(wrench: ArrayLike, frames: Frames) -> tuple[Array, Array]:
    """Force and torque (1, 3, ...), component first, aligned with the last axes of the frames.

    Args:
        wrench: Forces and torques (..., 6) or (6,) [N, N m]; what a load at another place has
            behind them, see `BodyPoint.of_load`, does not count here.
        frames: The poses.
    """
    W = np.asarray(wrench, dtype=float)
    W = W.transpose(-1, *range(W.ndim - 1))
    W = W[(slice(None),) + (None,) * (frames.position.ndim - W.ndim)]
    return W[None, :3], W[None, 3:WRENCH]


def shared_load(wrench: Array, part: float) -> Array:
    """A part of wrenches (..., 6 or 9), which acts where the whole of each does."""
    return np.concatenate([part * wrench[..., :WRENCH], wrench[..., WRENCH:]], axis=-1)


def load_turns(wrench: Array) -> Array:
    """Derivatives (3, m, 6 or 9) of wrenches (m, 6 or 9) that turn about each axis of the world.

    Each acts where the whole does, which does not turn: ``e x F`` and ``e x T`` for a unit vector
    e [N/rad, N m/rad].
    """
    parts = (wrench[:, : WRENCH // 2], wrench[:, WRENCH // 2 : WRENCH])
    turned = [np.cross(np.eye(3)[:, None], part) for part in parts]
    places = np.broadcast_to(wrench[:, WRENCH:], (3, len(wrench), wrench.shape[1] - WRENCH))
    return np.concatenate([*turned, places], axis=-1)


def all_wrenches(*wrenches: Array) -> Array:
    """Wrenches (k, 6 or 9) one below the other; those that act at the load point say so."""
    width = max(W.shape[1] for W in wrenches)
    return np.concatenate([np.pad(W, ((0, 0), (0, width - W.shape[1]))) for W in wrenches])
