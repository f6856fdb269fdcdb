"""Serial chains of revolute and prismatic joints: forward kinematics and Jacobian, batch first."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
Kind = Literal["revolute", "prismatic"]
NEXT, LAST = np.array([1, 2, 0]), np.array([2, 0, 1])  # of three components in turn
FEW = 20_000  # numbers whose copies cost less than more calls


def transform(position: ArrayLike = (0, 0, 0), rpy: ArrayLike = (0, 0, 0)) -> Array:
    """Homogeneous transform (4, 4) of a position [m] and fixed-axis roll, pitch, yaw angles [rad]."""
    T = np.eye(4)
    if np.any(rpy):
        T[:3, :3] = Rotation.from_euler("xyz", np.asarray(rpy, dtype=float)).as_matrix()
    T[:3, 3] = position
    return T


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint of the chain, relative to the frame of the joint before.

    Args:
        name: Name, as used in studies and column headers.
        origin: Transform (4, 4) to the joint's frame at q = 0 [m].
        axis: Axis of positive motion (3,) in that frame; normalised here.
        limits: Lower and upper limit [rad], or [m] for a prismatic joint.
        kind: "revolute" or "prismatic".

    Raises:
        ValueError: The axis is zero, the limits are not in order, or the kind is unknown.
    """

    name: str
    origin: Array
    axis: Array
    limits: tuple[float, float]
    kind: Kind = "revolute"

    def __post_init__(self) -> None:
        axis = np.asarray(self.axis, dtype=float)
        if axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any():
            raise ValueError(
                f"joint {self.name}: the axis must be a non-zero vector of three numbers"
            )
        if not self.limits[0] < self.limits[1]:
            raise ValueError(f"joint {self.name}: the lower limit must lie below the upper one")
        if self.kind not in ("revolute", "prismatic"):
            raise ValueError(
                f"joint {self.name}: kind must be 'revolute' or 'prismatic', not {self.kind!r}"
            )
        object.__setattr__(self, "axis", axis / np.linalg.norm(axis))


@dataclass(frozen=True, eq=False)
class Frames:
    """The chain in some poses, component first so that every operation runs over contiguous poses.

    Attributes:
        q: Joint variables (n, ...).
        axes: Joint axes in the base frame (n, 3, ...).
        origins: Points on the joint axes (n, 3, ...) [m].
        rotation: Columns of the tool frame's rotation: ``rotation[k]`` is its k-th unit vector (3, 3, ...).
        position: Tool point (3, ...) [m].
        prismatic: Mask (n,) of the prismatic joints.
    """

    q: Array
    axes: Array
    origins: Array
    rotation: Array
    position: Array
    prismatic: NDArray[np.bool_]

    def __getitem__(self, chosen: NDArray[np.int_]) -> "Frames":
        """The chain in some of the poses, chosen along the last axis."""
        arrays = {
            name: getattr(self, name).take(chosen, axis=-1)
            for name in ("q", "axes", "origins", "rotation", "position")
        }
        return replace(self, **arrays)

    @cached_property
    def linear(self) -> Array:
        """Velocity of the tool point per joint (n, 3, ...): ``a x (p - o)``, or ``a`` if prismatic."""
        J = cross(self.axes, self.position - self.origins)
        if self.prismatic.any():
            J[self.prismatic] = self.axes[self.prismatic]
        return J

    @cached_property
    def angular(self) -> Array:
        """Angular velocity of the tool per joint (n, 3, ...): ``a``, or zero if prismatic."""
        if not self.prismatic.any():
            return self.axes
        J = self.axes.copy()
        J[self.prismatic] = 0.0
        return J


def cross(a: Array, b: Array) -> Array:
    """Cross product along the second axis (m, 3, ...), leaving the others in place.

    Of few vectors it is taken in as few calls as possible, of many without copies of the inputs.
    """
    if max(a.size, b.size) < FEW:
        return a.take(NEXT, 1) * b.take(LAST, 1) - a.take(LAST, 1) * b.take(NEXT, 1)
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        np.multiply(a[:, j], b[:, k], out=out[:, i])
        out[:, i] -= a[:, k] * b[:, j]
    return out


def _aligned(axis: Array) -> Array:
    """A rotation (3, 3) whose third column is the axis; a signed permutation for a coordinate axis."""
    x = np.eye(3)[np.argmin(np.abs(axis))]
    x = x - axis * (axis @ x)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])


def _combine(columns: list[Array], weights: Array) -> Array | float:
    """Linear combination of frame columns (3, ...) with constant weights (3,), zeros skipped."""
    total: Array | float = 0.0
    for column, w in zip(columns, weights, strict=True):
        if abs(w) > 1e-15:
            total = total + (column if w == 1.0 else w * column)
    return total


@dataclass(frozen=True, eq=False)
class Robot:
    """A serial chain with a fixed base and tool transform. Immutable; `with_tool` makes another.

    Args:
        name: Name a person reads.
        joints: The joints from base to tip.
        base: Transform (4, 4) of the chain's root in the world [m].
        tool: Transform (4, 4) of the tool frame after the last joint [m].
        source: Where the numbers come from.

    Raises:
        ValueError: No joints, or two of one name.
    """

    name: str
    joints: tuple[Joint, ...]
    base: Array = field(default_factory=transform)
    tool: Array = field(default_factory=transform)
    source: str = ""

    def __post_init__(self) -> None:
        if not self.joints or len({j.name for j in self.joints}) < len(self.joints):
            raise ValueError(
                f"robot {self.name}: needs at least one joint, each with a name of its own"
            )

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints from base to tip."""
        return tuple(j.name for j in self.joints)

    @property
    def limits(self) -> Array:
        """Joint limits (2, n): lower and upper [rad or m]."""
        return np.array([j.limits for j in self.joints]).T

    @cached_property
    def reach(self) -> float:
        """An upper bound on the distance of any point of the chain from the world's origin [m]."""
        links = [self.base, self.tool, *(j.origin for j in self.joints)]
        slides = [max(map(abs, j.limits)) for j in self.joints if j.kind == "prismatic"]
        return float(sum(np.linalg.norm(T[:3, 3]) for T in links) + sum(slides))

    def with_tool(self, tool: Array) -> "Robot":
        """The same chain with another tool transform (4, 4)."""
        return replace(self, tool=np.array(tool, dtype=float))

    @cached_property
    def _links(self) -> list[tuple[Array, Array]]:
        """Constant rotation and translation before each joint, in frames whose z-axis is the joint axis."""
        links, before = [], np.eye(3)
        for joint in self.joints:
            F = _aligned(joint.axis)
            links.append((before @ joint.origin[:3, :3] @ F, before @ joint.origin[:3, 3]))
            before = F.T
        links.append((before @ self.tool[:3, :3], before @ self.tool[:3, 3]))
        return links

    @cached_property
    def _prismatic(self) -> NDArray[np.bool_]:
        """Mask (n,) of the prismatic joints."""
        return np.array([joint.kind == "prismatic" for joint in self.joints])

    def frames(self, q: ArrayLike) -> Frames:
        """Joint axes and tool frame in the poses q.

        Args:
            q: Joint variables (..., n) [rad or m].

        Raises:
            ValueError: The last axis of q is not n long.
        """
        q = np.asarray(q, dtype=float)
        if q.ndim < 1 or q.shape[-1] != self.n:
            raise ValueError(
                f"q has shape {q.shape}, expected (..., {self.n}) for robot {self.name}"
            )
        q = np.ascontiguousarray(np.moveaxis(q, -1, 0))
        batch = q.shape[1:]
        axes, origins = np.empty((2, self.n, 3, *batch))
        lift = (slice(None),) + (None,) * len(batch)
        R = [self.base[:3, k][lift] for k in range(3)]
        p = self.base[:3, 3][lift]
        for j, (joint, (C, t)) in enumerate(zip(self.joints, self._links[:-1], strict=True)):
            p = p + _combine(R, t)
            R = [_combine(R, C[:, k]) for k in range(3)]  # type: ignore[misc]
            axes[j], origins[j] = R[2], p
            if joint.kind == "prismatic":
                p = p + q[j] * R[2]
            else:
                c, s = np.cos(q[j]), np.sin(q[j])
                R = [c * R[0] + s * R[1], c * R[1] - s * R[0], R[2]]
        C, t = self._links[-1]
        position, rotation = np.empty((3, *batch)), np.empty((3, 3, *batch))
        position[...] = p + _combine(R, t)
        for k in range(3):
            rotation[k] = _combine(R, C[:, k])
        return Frames(q, axes, origins, rotation, position, self._prismatic)

    def forward(self, q: ArrayLike) -> Array:
        """Pose of the tool frame in the world.

        Args:
            q: Joint variables (..., n) [rad or m].

        Returns:
            Homogeneous transforms (..., 4, 4) [m].
        """
        frames = self.frames(q)
        T = np.zeros((*frames.position.shape[1:], 4, 4))
        T[..., :3, :3] = np.moveaxis(frames.rotation, (0, 1), (-1, -2))
        T[..., :3, 3] = np.moveaxis(frames.position, 0, -1)
        T[..., 3, 3] = 1.0
        return T

    def jacobian(self, q: ArrayLike) -> Array:
        """Geometric Jacobian at the tool point, in world axes: linear rows [m/rad], then angular rows.

        Args:
            q: Joint variables (..., n) [rad or m].

        Returns:
            Jacobians (..., 6, n).
        """
        frames = self.frames(q)
        J = np.concatenate([frames.linear, frames.angular], axis=1)
        return np.moveaxis(J, (0, 1), (-1, -2))
