"""A chain by products of homogeneous transforms, and the compensators between its bodies."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from edtk.certificate.recompute.plain_data import number, numbers, rows, table, text, whole
from edtk.system.typing import Array, Mask

MOST_JOINTS = 200  # twice those that edtk reads from a URDF, for joints that follow others
LARGEST_FACTOR = 1e6  # of a joint that follows another one, in SI units
RIGID = 1e-9  # deviation of a rotation's columns from orthonormal ones, against rounding
JOINT = ("name", "kind", "origin", "axis", "limits")
ORIGIN = np.zeros(3)
KEYS = ("pull", "joint", "anchors", "stiffness", "preload")
MOST_COMPENSATORS = 64
WHERE = "setting.gives"


@dataclass(frozen=True, eq=False)
class Chain:
    """A serial chain as a certificate writes it down.

    Of its N joints, n have drives with the coordinates q. The variables of all are ``x = P q + b``:
    some joints follow others, and some drives turn several.

    Attributes:
        base: Transform (4, 4) of the chain's root [m].
        origins: Transforms (N, 4, 4) from each joint to the next at zero [m].
        axes: Unit axes (N, 3) in the joints' frames.
        slides: Which joints (N,) are prismatic.
        limits: Lower and upper limits (2, n) of the drives [rad or m].
        tool: Transform (4, 4) of the tool after the last joint [m].
        endless: Which free joints (n,) turn without end: they draw within their limits, and may
            stand beyond.
        ties: P (N, n) and b (N,), the identity and zero for joints with drives of their own.
        free: Indices (n,) of the free joints among all.
        coupled: Rows (c, n) of P whose joints have limits of their own, and these (2, c).
    """

    base: Array
    origins: Array
    axes: Array
    slides: Mask
    limits: Array
    tool: Array
    endless: Mask
    ties: tuple[Array, Array]
    free: list[int]
    coupled: tuple[Array, Array]
    _last: list[tuple[Array, Array]] = field(default_factory=list, init=False, repr=False)

    @classmethod
    def from_dict(cls, robot: Any) -> "Chain":
        """Read a robot from a certificate.

        Raises:
            ValueError: The content is no robot.
        """
        where = "setting.robot"
        robot = table(robot, ("name", "base", "tool", "joints"), where)
        joints = rows(robot["joints"], MOST_JOINTS, f"{where}.joints")
        if not joints:
            raise ValueError(f"{where}.joints: expected at least one")
        places = [f"{where}.joints[{j}]" for j in range(len(joints))]
        for joint, place in zip(joints, places, strict=True):
            table(joint, JOINT, place, ("follows", "continuous", "coupled"))
        kinds = [
            text(joint["kind"], ("revolute", "prismatic"), f"{place}.kind")
            for joint, place in zip(joints, places, strict=True)
        ]
        axes = numbers([joint["axis"] for joint in joints], (None, 3), f"{where}.joints.axis")
        limits = numbers([joint["limits"] for joint in joints], (None, 2), f"{where}.joints.limits")
        length = np.linalg.norm(axes, axis=1, keepdims=True)
        if not (length > 0).all() or not (limits[:, 0] < limits[:, 1]).all():
            raise ValueError(f"{where}.joints: expected axes that are not zero, limits in order")
        free = [j for j, joint in enumerate(joints) if "follows" not in joint]
        ties, own = _ties(joints, free, places)
        return cls(
            base=_rigid(robot["base"], f"{where}.base"),
            origins=np.array(
                [
                    _rigid(joint["origin"], f"{place}.origin")
                    for joint, place in zip(joints, places, strict=True)
                ]
            ),
            axes=axes / length,
            slides=np.array([kind == "prismatic" for kind in kinds]),
            limits=limits[free].T,
            tool=_rigid(robot["tool"], f"{where}.tool"),
            endless=np.array([joints[j].get("continuous") is True for j in free]),
            ties=ties,
            free=free,
            coupled=own,
        )

    @property
    def n(self) -> int:
        """Number of free joints."""
        return len(self.free)

    @property
    def ends(self) -> Array:
        """Limits (2, n) at which joints end: infinite for those that turn without end."""
        return np.where(self.endless, [[-np.inf], [np.inf]], self.limits)

    @property
    def prismatic(self) -> Mask:
        """Which free joints (n,) are prismatic."""
        return np.asarray(self.slides[self.free])

    @property
    def _is_tied(self) -> bool:
        """Whether a joint moves by other drives than its own."""
        return len(self.axes) > self.n or not np.array_equal(self.ties[0], np.eye(self.n))

    def _all(self, q: Array) -> Array:
        """Variables (k, N) of all joints for those of the free ones (k, n)."""
        P, b = self.ties
        return q @ P.T + b if self._is_tied else q

    def tool_point_and_axis(self, q: Array) -> tuple[Array, Array]:
        """Tool points [m] and z-axes of the tool frame, (k, 3) each, of poses q (k, n).

        Both vectors are carried from the tool back to the base, which takes a sixth of the time of
        all frames. Most candidates are dropped after this test.
        """
        x = self._all(q)
        sine = np.sin(x)
        cosine = np.cos(x)
        both = np.broadcast_to(self.tool[:3, [3, 2]].T[:, None], (2, len(q), 3))
        for j in reversed(range(len(self.axes))):
            origin = self.origins[j]
            if self.slides[j]:
                both = both @ origin[:3, :3].T
                both[0] += x[:, j, None] * (origin[:3, :3] @ self.axes[j])
            else:
                turned = both @ self._turning[j]
                both = turned[..., :3] + sine[:, j, None] * turned[..., 3:6]
                both += cosine[:, j, None] * turned[..., 6:]
            both[0] += origin[:3, 3]
        point, axis = both @ self.base[:3, :3].T
        return point + self.base[:3, 3], axis

    @cached_property
    def _turning(self) -> Array:
        """Matrices (N, 3, 9) that turn row vectors behind each joint to the frame before it.

        Side by side they give what stays, what counts by the sine of the angle, and by its cosine:
        ``a a'``, ``[a]x`` and ``I - a a'`` for the axis a (Rodrigues).
        """
        found = np.empty((len(self.axes), 3, 9))
        for axis, origin, own in zip(self.axes, self.origins, found, strict=True):
            along = np.outer(axis, axis)
            for i, part in enumerate((along, _skew(axis), np.eye(3) - along)):
                own[:, 3 * i : 3 * i + 3] = (origin[:3, :3] @ part).T
        return found

    def _motions(self, x: Array) -> Array:
        """Transforms (N, k, 4, 4) of all joints at x (k, N), by the formula of Rodrigues."""
        first, second = self._moving
        x = x.T[..., None, None]
        along = np.where(self.slides[:, None, None, None], x, np.sin(x))
        return np.asarray(np.eye(4) + along * first + (1.0 - np.cos(x)) * second)

    @cached_property
    def _moving(self) -> tuple[Array, Array]:
        """``[a]x`` and ``[a]x^2`` of axes a that turn; the shift by a and zero of those that slide.

        Each is a stack (N, 1, 4, 4).
        """
        first = np.zeros((len(self.axes), 4, 4))
        for axis, slides, own in zip(self.axes, self.slides, first, strict=True):
            if slides:
                own[:3, 3] = axis
            else:
                own[:3, :3] = _skew(axis)
        # What slides has no square.
        return first[:, None], (first @ first)[:, None]

    def jacobian(self, q: Array, offset: Array = ORIGIN, body: int | None = None) -> Array:
        """Jacobians (k, 6, n) of a point at poses q (k, n), linear rows first.

        Column j is ``(a_j x (p - o_j), a_j)`` for a revolute joint with axis a_j through o_j, and
        ``(a_j, 0)`` for a prismatic joint. Joints behind the body do not move its points.

        Args:
            q: Joint variables (k, n) [rad or m].
            offset: The point (3,), in the frame of its body [m].
            body: Index among all joints of the one that moves the body; None for the tool.
        """
        frames = self.frames(q)
        # A joint does not turn its own axis, nor what is on it.
        bodies = frames[:-1]
        axes = (bodies[..., :3, :3] @ self.axes[:, None, :, None])[..., 0]
        moved = _placed(frames[-1 if body is None else body], offset)
        slides = self.slides[:, None, None]
        by_each = np.empty((len(q), 6, len(axes)))
        columns = by_each.transpose(2, 0, 1)
        columns[..., :3] = np.where(slides, axes, _cross(axes, moved - bodies[..., :3, 3]))
        columns[..., 3:] = np.where(slides, 0.0, axes)
        if body is not None:
            columns[body + 1 :] = 0.0
        return by_each @ self.ties[0] if self._is_tied else by_each

    def point(self, q: Array, offset: Array = ORIGIN, body: int | None = None) -> Array:
        """Positions (k, 3) of a point, given as for `jacobian`, at poses q (k, n) [m]."""
        return _placed(self.frames(q)[-1 if body is None else body], offset)

    def frames(self, q: Array) -> Array:
        """Frames (N + 1, k, 4, 4) behind each of all joints, then of the tool, at poses q (k, n).

        They are kept for the next call: each parameter asks for those of the same poses.
        """
        for poses, frames in self._last:
            if np.array_equal(poses, q):
                return frames
        steps = self.origins[:, None] @ self._motions(self._all(q))
        frames = np.empty((len(steps) + 1, len(q), 4, 4))
        frame = np.broadcast_to(self.base, (len(q), 4, 4))
        for step, found in zip(steps, frames[:-1], strict=True):
            frame = np.matmul(frame, step, out=found)
        np.matmul(frame, self.tool, out=frames[-1])
        frames.flags.writeable = False
        self._last[:] = [(q.copy(), frames)]
        return frames


Affine = tuple[Array, Array]


def _ties(
    joints: list[dict[str, Any]], free: list[int], places: list[str]
) -> tuple[Affine, Affine]:
    """How the drives move all joints, and limits of joints that several of them move.

    A free joint has ``x_j = q_j + sum_m factor x_m``, with a sum over the joints that it is coupled
    to, so that ``x = (I - F)^-1 q``; one that follows has the sum without a drive of its own.

    Returns:
        Factors (N, n) and offsets (N,); rows (c, n) and limits (2, c).

    Raises:
        ValueError: A joint follows one that is not free, or is coupled in a circle.
    """
    if not free:
        raise ValueError("setting.robot.joints: expected one that follows no other")
    n = len(free)
    offsets = np.zeros(len(joints))
    sums = np.zeros((len(joints), n))  # of variables of free joints
    limited: list[tuple[int, Array]] = []
    for j, (joint, place) in enumerate(zip(joints, places, strict=True)):
        if "follows" in joint:
            where = f"{place}.follows"
            tie = table(joint["follows"], ("joint", "factor", "offset"), where, ("others",))
            offsets[j] = number(tie["offset"], f"{where}.offset")
            own = {key: tie[key] for key in ("joint", "factor")}
            entries = [own, *rows(tie.get("others", []), n, f"{where}.others")]
        else:
            where = f"{place}.coupled"
            entries = rows(joint.get("coupled", []), n, where)
        for one in entries:
            table(one, ("joint", "factor"), where, ("limits",))
            master = whole(one["joint"], 0, n - 1, f"{where}.joint")
            sums[j, master] += number(one["factor"], f"{where}.factor")
            if "limits" in one:
                limited.append((j, numbers(one["limits"], (2,), f"{where}.limits")))
    between = sums[free]
    if np.linalg.matrix_power(between != 0, n).any() or np.abs(sums).max() > LARGEST_FACTOR:
        raise ValueError("setting.robot.joints: expected factors up to 1e6, and no circles")
    by_drives = np.linalg.solve(np.eye(n) - between, np.eye(n))
    P = sums @ by_drives
    P[free] = by_drives
    ends = np.array([limits for _, limits in limited]).reshape(-1, 2).T
    return (P, offsets), (P[[j for j, _ in limited]], ends)


def _placed(frame: Array, offset: Array) -> Array:
    """Points (k, 3) at an offset (3,) in frames (k, 4, 4)."""
    position = frame[:, :3, 3]
    return position + frame[:, :3, :3] @ offset if offset.any() else position


def _skew(a: Array) -> Array:
    """The matrix ``[a]x`` (3, 3) with ``[a]x v = a x v``."""
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _cross(a: Array, b: Array) -> Array:
    """``a x b`` of vectors (..., 3)."""
    out = np.empty(a.shape)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[..., j], b[..., k], out=out[..., i])
        out[..., i] -= a[..., k] * b[..., j]
    return out


def _rigid(value: Any, where: str) -> Array:
    """A transform (4, 4) that keeps lengths and handedness.

    Raises:
        ValueError: It is none.
    """
    found = numbers(value, (4, 4), where)
    rotation = found[:3, :3]
    away = np.abs(rotation.T @ rotation - np.eye(3)).max()
    if not away <= RIGID or np.linalg.det(rotation) < 0 or (found[3] != [0, 0, 0, 1]).any():
        raise ValueError(f"{where}: expected a rotation and a translation")
    return found


@dataclass(frozen=True, eq=False)
class Pull:
    """A coil spring or a gas cylinder across a joint.

    Attributes:
        kind: "coil" or "gas".
        joint: Index of the joint among all, which is a free one.
        anchors: On the body before the joint, and on the one behind it (2, 3), in the frame of the
            joint at zero [m].
        stiffness: Slope of the force by the distance, at zero [N/m].
        preload: Force at zero [N].
    """

    kind: str
    joint: int
    anchors: Array
    stiffness: float
    preload: float

    @classmethod
    def from_dict(cls, content: Any, n: int, where: str) -> "Pull":
        """Read a compensator of a robot with n joints.

        Raises:
            ValueError: It is none.
        """
        content = table(content, KEYS, where)
        return cls(
            text(content["pull"], ("coil", "gas"), f"{where}.pull"),
            whole(content["joint"], 0, n - 1, f"{where}.joint"),
            numbers(content["anchors"], (2, 3), f"{where}.anchors"),
            number(content["stiffness"], f"{where}.stiffness"),
            number(content["preload"], f"{where}.preload"),
        )

    def changed(self, number: int, change: float) -> "Pull":
        """The same with a change of one of its numbers.

        They are six coordinates of the anchors [m], the stiffness [N/m] and the preload [N].
        """
        anchors = self.anchors.copy()
        if number < anchors.size:
            anchors.flat[number] += change
            return replace(self, anchors=anchors)
        if number == anchors.size:
            return replace(self, stiffness=self.stiffness + change)
        return replace(self, preload=self.preload + change)

    def on(self, chain: Chain, q: Array) -> tuple[Array, Array]:
        """Load (k, n) of the free joints, and its slope (k, n) by the joint itself.

        The anchor behind the joint turns with it. It is pulled along the line to the other one, by
        a force whose moment about the axis is the load.
        """
        axis = chain.axes[self.joint]
        turned, u, length, force, slope = self._pulling(chain, q)
        velocity = np.cross(axis, turned)
        lever = (u * velocity).sum(axis=1)
        inward = (u * np.cross(axis, velocity)).sum(axis=1)
        bent = ((velocity**2).sum(axis=1) - lever**2) / length + inward
        load, by_joint = np.zeros((2, *q.shape))
        at = chain.free.index(self.joint)
        load[:, at] = -force * lever
        by_joint[:, at] = -(slope * lever**2 + force * bent)
        return load, by_joint

    def along(self, chain: Chain, q: Array, end: int) -> Array:
        """Load (k,) of a shift along an axis of the joint's frame (0 to 2), or of a turn (3 to 5).

        These move what the joint carries against the body before.
        """
        turned, u, _, force, _ = self._pulling(chain, q)
        axis = np.eye(3)[end % 3]
        moved = axis if end < len(axis) else np.cross(axis, turned)
        return np.asarray(-force * (u * moved).sum(axis=1))

    def _pulling(self, chain: Chain, q: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Anchor behind the joint (k, 3), direction there, distance, force, slope of the force."""
        angle = q[:, chain.free.index(self.joint), None]
        axis = chain.axes[self.joint]
        fixed, point = self.anchors
        along = (point @ axis) * axis
        aside = np.cross(axis, point)
        turned = along + np.cos(angle) * (point - along) + np.sin(angle) * aside
        line = turned - fixed
        length = np.linalg.norm(line, axis=1)
        longer = length - np.linalg.norm(point - fixed)
        force = self.preload + self.stiffness * longer
        slope = np.full_like(force, self.stiffness)
        if self.kind == "gas":
            room = 1 - self.stiffness * longer / self.preload
            force = self.preload / room
            slope = self.stiffness / room**2
        return turned, line / length[:, None], length, force, slope


@dataclass(frozen=True, eq=False)
class Gives:
    """By how much less joints with compensators give way, about a guess of their compliances.

    Attributes:
        pulls: The compensators.
        compliances: The guess (n,) [rad/(N m)].
    """

    pulls: list[Pull]
    compliances: Array

    @classmethod
    def from_dict(cls, content: Any, chain: Chain) -> "Gives":
        """Read the part `setting.gives` of a certificate.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        content = table(content, ("pulls", "compliances"), WHERE)
        given = rows(content["pulls"], MOST_COMPENSATORS, f"{WHERE}.pulls")
        pulls = [
            Pull.from_dict(one, len(chain.axes), f"{WHERE}.pulls[{i}]")
            for i, one in enumerate(given)
        ]
        if any(one.joint not in chain.free for one in pulls):
            raise ValueError(f"{WHERE}.pulls: expected joints that follow no other")
        return cls(pulls, numbers(content["compliances"], (chain.n,), f"{WHERE}.compliances"))

    def factors(self, chain: Chain, q: Array) -> Array:
        """``1 / (1 - k dtau/dq)`` (k, n): of what turns such a joint, that much is left."""
        slopes = np.zeros_like(q)
        for pull in self.pulls:
            slopes += pull.on(chain, q)[1]
        return np.asarray(1 / (1 - self.compliances * slopes))
