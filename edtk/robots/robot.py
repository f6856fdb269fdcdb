"""Serial chains of revolute and prismatic joints: forward kinematics and Jacobian, batch first."""

import hashlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from edtk.robots.compensator import Compensator, GivingWay, Pull, pull_of
from edtk.robots.controller import Controller
from edtk.robots.frames import Frames, Terms, combine_terms, terms_of
from edtk.robots.joint import Coupling, Joint, Link, TiedJoint, Ties, variables_by_drives
from edtk.robots.rotations import transform
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices, Mask


@dataclass(frozen=True, eq=False)
class Robot(Presented):
    """A serial chain with a fixed base and tool transform. Immutable; `with_tool` makes another.

    Args:
        name: Name for people.
        joints: The joints that are free, from base to tip: they have variables, limits and springs.
        base: Transform (4, 4) of the chain's root in the world [m].
        tool: Transform (4, 4) of the tool frame after the last joint [m].
        source: Where the numbers come from.
        links: The bodies that the joints of `chain` move, one a joint; empty where unknown.
        flange: Transform (4, 4) of the frame in which tools are given, after the last joint [m]:
            the tip link of a URDF. `tool` is after the last joint nevertheless.
        controller: How the robot's controller counts the joints; None if as in the model.
        tied: Joints that follow others, in the order of the chain.
        couplings: Free joints whose drives turn them against other bodies than the one before: the
            robot's variables q are then the coordinates of the drives.
        compensators: Springs and gas cylinders across free joints.

    Raises:
        ValueError: The chain has no joints, or two of one name, or links for some joints only, or a
            joint follows one that is not free, or couplings are wrong or leave no pose, or a
            compensator does not fit its joint.
    """

    name: str
    joints: tuple[Joint, ...]
    base: Array = field(default_factory=transform)
    tool: Array = field(default_factory=transform)
    source: str = ""
    links: tuple[Link, ...] = ()
    flange: Array = field(default_factory=transform)
    controller: Controller | None = None
    tied: tuple[TiedJoint, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    compensators: tuple[Compensator, ...] = ()

    def __post_init__(self) -> None:
        for tied in self.tied:
            for master, _ in tied.follows:
                if master not in self.joint_names:
                    has = ", ".join(self.joint_names)
                    raise ValueError(
                        f"joint {tied.name}: follows {master!r}; the free joints are {has}"
                    )
        names = [joint.name for joint in self.chain]
        if not self.joints or len(set(names)) < len(names):
            raise ValueError(
                f"robot {self.name}: needs at least one joint, each with a name of its own"
            )
        if len(self.links) not in (0, len(names)):
            raise ValueError(
                f"robot {self.name}: has {len(self.links)} links; expected one for each of its "
                f"{len(names)} joints, or none"
            )
        if self.couplings:
            self._require_poses()

        for one in self.compensators:
            self.pull_of(one)

    def _require_poses(self) -> None:
        """Check that there are poses within the limits of drives and of joints that are coupled.

        Raises:
            ValueError: There are none, or couplings are wrong.
        """
        bounds = self.bounds.coupled
        for row, limits, name in zip(bounds.rows, bounds.limits.T, bounds.names, strict=True):
            reached = _ends(row, self.limits)
            if max(limits[0], reached[0]) > min(limits[1], reached[1]):
                asked, left = (
                    f"{low:.6g} .. {high:.6g} deg" for low, high in np.rad2deg([limits, reached])
                )
                raise ValueError(
                    f"there is no pose: {name} is to be within {asked}, and the limits of the "
                    f"drives leave {left}"
                )

    def headline(self) -> str:
        """Name, and the joints by name."""
        return f"{self.name}, joints {', '.join(self.joint_names)}"

    @property
    def n(self) -> int:
        """Number of free joints."""
        return len(self.joints)

    @cached_property
    def chain(self) -> tuple[Joint, ...]:
        """All N joints from base to tip, those that follow others too.

        These have the limits between which their variables are where the drives are at theirs.
        """
        chain = list(self.joints)
        for tied, row in zip(self.tied, self._tied_rows, strict=True):
            lower, upper = tied.offset + _ends(row, self.limits)
            limits = (float(lower), float(upper))
            joint = Joint(tied.name, tied.origin, tied.axis, limits, tied.kind)
            chain.insert(tied.place, joint)
        return tuple(chain)

    @cached_property
    def body_names(self) -> tuple[str, ...]:
        """Names of all joints of `chain`, each of which moves a body."""
        names = list(self.joint_names)
        for tied in self.tied:
            names.insert(tied.place, tied.name)
        return tuple(names)

    @cached_property
    def by_drives(self) -> Array:
        """Variables of the free joints by the coordinates of their drives (n, n)."""
        return variables_by_drives(self.joints, self.couplings)

    @cached_property
    def _tied_rows(self) -> Array:
        """Variables of the joints that follow others (t, n), by the coordinates of the drives."""
        factors = np.zeros((len(self.tied), self.n))
        for row, tied in zip(factors, self.tied, strict=True):
            for master, factor in tied.follows:
                row[self.joint_names.index(master)] = factor
        return factors @ self.by_drives

    @cached_property
    def ties(self) -> Ties | None:
        """How all joints follow the drives of the free ones; None where each has its own alone."""
        if not self.tied and not self.couplings:
            return None
        free = [self.body_names.index(name) for name in self.joint_names]
        following = [self.body_names.index(tied.name) for tied in self.tied]
        matrix = np.zeros((len(self.body_names), self.n))
        matrix[free] = self.by_drives
        matrix[following] = self._tied_rows
        offset = np.zeros(len(self.body_names))
        offset[following] = [tied.offset for tied in self.tied]
        return Ties(matrix, offset, free)

    @cached_property
    def bounds(self) -> "Bounds":
        """All that limits poses: the range of each drive, and of joints that are coupled."""
        limited = [one for one in self.couplings if one.limits is not None]
        of = [*range(self.n), *(self.joint_names.index(one.joint) for one in limited)]
        own = np.array([one.limits for one in limited]).reshape(-1, 2).T
        return Bounds(
            rows=np.concatenate([np.eye(self.n), self.by_drives[of[self.n :]]]),
            limits=np.concatenate([self.hard_limits, own], axis=1),
            of=of,
            names=(*self.joint_names, *(f"{one.joint} itself" for one in limited)),
        )

    @cached_property
    def pulls(self) -> tuple[Pull, ...]:
        """The compensators on their joints."""
        return tuple(map(self.pull_of, self.compensators))

    def pull_of(self, one: Compensator) -> Pull:
        """A compensator on its joint.

        Raises:
            ValueError: The joint is none of the free ones, or the compensator does not fit it.
        """
        if one.joint not in self.joint_names:
            masters = {tied.name: " and ".join(tied.masters) for tied in self.tied}
            what = f"no joint {one.joint!r}"
            if one.joint in masters:
                what = f"{one.joint} follows {masters[one.joint]}, and has no spring of its own"
            raise ValueError(f"{what}; this robot has {', '.join(self.joint_names)}")
        j = self.joint_names.index(one.joint)
        if not np.array_equal(self.by_drives[j], np.eye(self.n)[j]):
            raise ValueError(
                f"{one.joint} is turned by the drives of other joints too; expected a joint that "
                "its own drive alone turns"
            )
        joint = self.joints[j]
        return pull_of(one, self.body_names.index(one.joint), joint)

    def giving_way(self, k: Array, brought: bool = False) -> GivingWay | None:
        """How joints with compensators give way; None without any, or where none is compliant.

        Args:
            k: Compliances (n,) of the free joints [rad/(N m)].
            brought: Whether poses are those under load, as in a task.
        """
        pulls = {self.joint_names.index(one.given.joint): one for one in self.pulls}
        if not any(k[j] for j in pulls):
            return None
        free = tuple(map(self.body_names.index, self.joint_names))
        return GivingWay(self.pulls, np.asarray(k, dtype=float), free, brought)

    @cached_property
    def digest(self) -> str:
        """A name of the drawing: digits that differ where a length, an axis or a spring does."""
        numbers = [self.base, self.tool, *(joint.origin for joint in self.chain)]
        text = " ".join(f"{x:.9f}" for T in numbers for x in np.ravel(T) + 0.0)
        axes = (f"{joint.name} {joint.kind} {joint.axis.tolist()}" for joint in self.chain)
        text += " ".join(axes)
        text += "".join(f" {one.joint} {one.follows} {one.factor:.9f}" for one in self.couplings)
        return _digest(text + self._springs)

    @property
    def compensators_digest(self) -> str:
        """A name of the compensators alone; empty without any."""
        return _digest(self._springs) if self.compensators else ""

    @property
    def _springs(self) -> str:
        """The compensators in words and numbers."""
        return " ".join(f"{one.joint} {one.medium} {one.numbers()}" for one in self.compensators)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the free joints from base to tip."""
        return tuple(joint.name for joint in self.joints)

    @property
    def limits(self) -> Array:
        """Joint limits (2, n): lower and upper [rad or m]."""
        return np.array([joint.limits for joint in self.joints]).T

    @cached_property
    def slides(self) -> Mask:
        """Mask (n,) of the free joints that slide, and do not turn."""
        return np.array([joint.kind == "prismatic" for joint in self.joints])

    @cached_property
    def units(self) -> Array:
        """SI units (n,) in the unit in which people read a joint: degree or millimetre."""
        return np.where(self.slides, 1e-3, np.pi / 180)

    def shown(self, q: Array) -> Array:
        """What the controller shows (..., n) for joint variables q (..., n) [rad or m]."""
        return q if self.controller is None else self.controller.shown_of(q)

    def shown_change(self, change: Array) -> Array:
        """By how much that changes (..., n) with a change (..., n) of q [rad or m]."""
        return change if self.controller is None else self.controller.shown_change(change)

    def of_shown(self, shown: Array) -> Array:
        """Joint variables q (..., n) for what the controller shows (..., n) [rad or m]."""
        return shown if self.controller is None else self.controller.model_of(shown)

    @cached_property
    def continuous(self) -> Mask:
        """Mask (n,) of the joints that turn without end."""
        return np.array([joint.continuous for joint in self.joints])

    @property
    def hard_limits(self) -> Array:
        """Limits (2, n) at which joints end: infinite for those that turn without end."""
        return np.where(self.continuous, [[-np.inf], [np.inf]], self.limits)

    def within_one_turn(self, q: Array) -> Array:
        """The same poses q (..., n), joints that turn without end between -180 and 180 deg."""
        if not self.continuous.any():
            return q
        return np.where(self.continuous, q - 2 * np.pi * np.round(q / (2 * np.pi)), q)

    @cached_property
    def reach(self) -> float:
        """An upper bound on the distance of any point of the chain from the world's origin [m]."""
        links = [self.base, self.tool, *(joint.origin for joint in self.chain)]
        sliding = [joint for joint in self.chain if joint.kind == "prismatic"]
        slides = [max(map(abs, joint.limits)) for joint in sliding]
        return float(sum(np.linalg.norm(T[:3, 3]) for T in links) + sum(slides))

    @property
    def tool_is_from(self) -> str:
        """From where tools are given, in words."""
        return "last joint" if np.array_equal(self.flange, np.eye(4)) else "flange"

    def with_tool(self, tool: Array) -> "Robot":
        """The same chain with another tool transform (4, 4) in the frame of the flange [m]."""
        tool = np.array(tool, dtype=float)
        # A product with the identity would turn negative zeros into positive ones.
        plain = np.array_equal(self.flange, np.eye(4))
        return replace(self, tool=tool if plain else self.flange @ tool)

    def with_limits(self, limits: Mapping[str, tuple[float, float]]) -> "Robot":
        """The same chain with other limits of some joints, by name [rad or m].

        Of a joint that is coupled they are those of its drive.

        A continuous joint that is limited is no longer continuous.

        Raises:
            ValueError: The chain has no such joint, or limits are not in order.
        """
        for name in limits:
            if name not in self.joint_names:
                has = ", ".join(self.joint_names)
                raise ValueError(f"robot {self.name}: no joint {name!r}; it has {has}")
        joints = tuple(
            replace(joint, limits=limits[joint.name], continuous=False)
            if joint.name in limits
            else joint
            for joint in self.joints
        )
        return replace(self, joints=joints) if limits else self

    @cached_property
    def _links(self) -> list[tuple[list[Terms], Terms]]:
        """Constant rotation and translation before each joint, and before the tool.

        A rotation (3, 3) is given by the terms of its columns.

        They are those between frames whose z-axis is the joint axis, so that each joint turns its
        frame about z. A rotation about a coordinate axis is then a signed permutation, whose zeros
        and ones `combine_terms` skips.
        """
        links = []
        before = np.eye(3)
        for joint in self.chain:
            F = joint.aligned
            links.append((before @ joint.origin[:3, :3] @ F, before @ joint.origin[:3, 3]))
            before = F.T
        links.append((before @ self.tool[:3, :3], before @ self.tool[:3, 3]))
        return [([terms_of(C[:, k]) for k in range(3)], terms_of(t)) for C, t in links]

    @cached_property
    def _aligned(self) -> list[list[Terms]]:
        """Each joint's own frame, from that whose z-axis is the joint axis, by columns."""
        return [[terms_of(row) for row in joint.aligned] for joint in self.chain]

    @cached_property
    def chain_slides(self) -> Mask:
        """Mask (N,) of the prismatic joints of the chain."""
        return np.array([joint.kind == "prismatic" for joint in self.chain])

    def frames(self, q: ArrayLike, bodies: Collection[int] = ()) -> Frames:
        """Joint axes and tool frame in the poses q.

        Args:
            q: Joint variables (..., n) [rad or m].
            bodies: Indices of joints of `chain`; the frames of the bodies that they move are kept
                too.

        Raises:
            ValueError: The last axis of q is not n long.
        """
        q = np.asarray(q, dtype=float)
        if q.ndim < 1 or q.shape[-1] != self.n:
            raise ValueError(
                f"q has shape {q.shape}, expected (..., {self.n}) for robot {self.name}"
            )
        q = np.ascontiguousarray(np.moveaxis(q, -1, 0))
        x = q if self.ties is None else self.ties.variables(q)
        batch = q.shape[1:]
        # One block of memory for both: of many poses, two blocks are returned to the system and
        # asked for again by each call, which costs a third more.
        axes, origins = np.empty((2, len(self.chain), 3, *batch))
        lift = (slice(None),) + (None,) * len(batch)
        kept = {}
        R = [self.base[:3, k][lift] for k in range(3)]
        p = self.base[:3, 3][lift] + 0.0
        for j, (joint, (C, t)) in enumerate(zip(self.chain, self._links[:-1], strict=True)):
            p = p + combine_terms(R, t) if t else p
            R = [combine_terms(R, column) for column in C]
            # Nothing is added to what is kept, but the sign of zeros.
            np.add(R[2], 0.0, out=axes[j])
            origins[j] = p
            if joint.kind == "prismatic":
                p = p + x[j] * R[2]
            else:
                c = np.cos(x[j])
                s = np.sin(x[j])
                R = [c * R[0] + s * R[1], c * R[1] - s * R[0], R[2]]
            if j in bodies:
                rotation = np.empty((3, 3, *batch))
                for k, column in enumerate(self._aligned[j]):
                    rotation[k] = combine_terms(R, column)
                rotation += 0.0
                kept[j] = (rotation, np.broadcast_to(p, (3, *batch)))
        C, t = self._links[-1]
        position = np.empty((3, *batch))
        rotation = np.empty((3, 3, *batch))
        position[...] = p + combine_terms(R, t) if t else p
        for k in range(3):
            np.add(combine_terms(R, C[k]), 0.0, out=rotation[k])
        return Frames(q, axes, origins, rotation, position, self.chain_slides, kept, self.ties)

    def frames_of(self, known: Frames, bodies: Collection[int], chosen: Indices) -> Frames:
        """Frames of chosen ones of some poses, along one axis; bodies that are known stay.

        Args:
            known: Frames of the poses, which may lack bodies.
            bodies: See `frames`.
            chosen: Indices (k,) of the poses, in the order of the flattened ones.
        """
        if set(bodies) <= set(known.bodies):
            flat = known.flat
            every = len(chosen) == flat.q.shape[1] and (np.diff(chosen) > 0).all()
            return flat if every else flat[chosen]
        return self.frames(known.flat.q[:, chosen].T, bodies)

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
        """Geometric Jacobian at the tool point, in world axes.

        Args:
            q: Joint variables (..., n) [rad or m].

        Returns:
            Jacobians (..., 6, n): three linear rows [m/rad], then three angular rows.
        """
        frames = self.frames(q)
        J = np.concatenate([frames.linear, frames.angular], axis=1)
        return np.moveaxis(J, (0, 1), (-1, -2))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:12]


def joint_distance(q: Array, other: Array, prismatic: Mask) -> Array:
    """Distances (...) of poses [rad]: Euclidean over the revolute joints, the short way round.

    Args:
        q: Poses (..., n) [rad or m].
        other: Poses (..., n) to which the distances are.
        prismatic: Which joints (n,) are prismatic; they do not count.
    """
    turn = np.mod((q - other)[..., ~prismatic] + np.pi, 2 * np.pi) - np.pi
    return np.asarray(np.sqrt(np.square(turn).sum(axis=-1)))


@dataclass(frozen=True)
class ShownLimit:
    """A joint's range as a person reads it at the controller.

    The limits are those of the model's joint. A joint that follows another one has them for a sum:
    ``q_3 = s (c_3 - z_3 + f (c_2 - z_2))`` between l and u bounds ``c_3 + f c_2``.

    Attributes:
        label: What is bounded: "q3", or "q3 + q2" for a joint that follows.
        sign: 1, or -1 if the controller counts the other way round.
        offset: Value at the model's zero [rad or m].
    """

    label: str
    sign: float
    offset: float

    def of(self, value: float) -> float:
        """The controller's value for one of the model's joint variable [rad or m]."""
        return self.offset + self.sign * value

    def range(self, limits: tuple[float, float]) -> tuple[float, float]:
        """Lower and upper limit at the controller for those of the model [rad or m]."""
        first, second = map(self.of, limits)
        return (first, second) if self.sign > 0 else (second, first)


@dataclass(frozen=True, eq=False)
class Bounds:
    """Linear bounds on poses: ``lower <= R q <= upper``.

    Attributes:
        rows: R (c, n): the identity, then a row for each limit of a joint that is coupled.
        limits: Lower and upper bounds (2, c) [rad or m], infinite where there is none.
        of: Index (c,) of the joint that each bounds.
        names: What is bounded (c,): "q3" for the number of a pose, which is that of a drive, and
            "q3 itself" for the angle of a joint that is coupled, as the robot's drawing has it.
    """

    rows: Array
    limits: Array
    of: list[int]
    names: tuple[str, ...]

    @property
    def coupled(self) -> "Bounds":
        """Those of joints that are coupled."""
        n = self.rows.shape[1]
        return Bounds(self.rows[n:], self.limits[:, n:], self.of[n:], self.names[n:])

    def values(self, q: Array) -> Array:
        """What is bounded (..., c), of poses q (..., n) [rad or m]."""
        return np.asarray(q @ self.rows.T)

    def excess(self, q: Array) -> Array:
        """By how much poses q (..., n) are beyond each bound (..., c), negative within."""
        values = self.values(q)
        lower, upper = self.limits
        return np.maximum(lower - values, values - upper)

    def hold(self, q: Array) -> Mask:
        """Whether each pose (..., n) is within all bounds."""
        return np.asarray((self.excess(q) <= 0).all(axis=-1))


def _ends(row: Array, limits: Array) -> Array:
    """Least and largest value (2,) of ``row q`` with q between limits (2, n)."""
    return np.sort(row * limits, axis=0).sum(axis=1)


@dataclass(frozen=True)
class Beyond:
    """A value of a pose that is beyond its limits, as a person reads it [deg or mm].

    Attributes:
        joint: Index of the joint.
        name: What is limited: "q3", "q3 + q2" for a joint that the controller counts against
            another one, or "q3 itself".
        value: Its value.
        limits: Its lower and upper limit.
    """

    joint: int
    name: str
    value: float
    limits: tuple[float, float]

    @classmethod
    def of(cls, robot: Robot, q: Array, row: int) -> "Beyond":
        """Bound number `row` of the robot in a pose q (n,) [rad or m]."""
        bounds = robot.bounds
        j = bounds.of[row]
        own = ShownLimit(bounds.names[row], 1.0, 0.0)
        shown = shown_limits(robot)[j] if row < robot.n else own
        low, high = bounds.limits[:, row]
        value = bounds.values(q)[row]
        unit = robot.units[j]
        low, high = (limit / unit for limit in shown.range((low, high)))
        return cls(j, shown.label, float(shown.of(value) / unit), (float(low), float(high)))


def motors_in_words(robot: Robot) -> tuple[str, ...]:
    """What the numbers of joints that are coupled mean, a sentence for each; none without any."""
    bounds = robot.bounds.coupled
    ranges: dict[str, list[str]] = {}
    for j, (low, high) in zip(bounds.of, np.rad2deg(bounds.limits.T), strict=True):
        ranges.setdefault(robot.joint_names[j], []).append(f", within {low:.6g} .. {high:.6g} deg")
    whose = "" if robot.controller is None else "in the model, "
    found = []
    for name in dict.fromkeys(one.joint for one in robot.couplings):
        own = name
        row = robot.by_drives[robot.joint_names.index(name)]
        for other, factor in zip(robot.joint_names, row, strict=True):
            if factor and other != name:
                size = "" if abs(factor) == 1 else f"{abs(factor):.4g} "
                own += f" {'-' if factor < 0 else '+'} {size}{other}"
        own += "".join(ranges.get(name, []))
        found.append(f"{whose}{name} is the angle of its motor; the joint itself is at {own}")
    return tuple(found)


def shown_limits(robot: Robot) -> tuple[ShownLimit, ...]:
    """How the limits of each joint are to be read at the controller."""
    controller = robot.controller
    if controller is None:
        return tuple(ShownLimit(name, 1.0, 0.0) for name in robot.joint_names)
    zero = np.asarray(controller.zero * controller.units)
    found = []
    for j, name in enumerate(robot.joint_names):
        label = name
        offset = float(zero[j])
        for one in controller.follows:
            if one.joint == j:
                size = "" if abs(one.factor) == 1 else f"{abs(one.factor):g} "
                label += f" {'+' if one.factor > 0 else '-'} {size}{robot.joint_names[one.leader]}"
                offset += float(one.factor * zero[one.leader])
        found.append(ShownLimit(label, float(controller.sign[j]), offset))
    return tuple(found)
