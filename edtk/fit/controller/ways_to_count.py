"""Ways to count the joints, which of them make the same arm, and whole turns."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from edtk.fit.controller.fits import Fits, Positions, descend, place_frames
from edtk.measure.pose_table import DIGITS
from edtk.robots.controller import Follows
from edtk.robots.joint import Ties
from edtk.robots.robot import Robot
from edtk.system.typing import Array, Indices, Mask

WHOLE_FACTOR = 1e-9  # of a factor that counts as whole
TRIAL_POSES = 5
MARKERS = 4
STEPS = 40
SAME_ARM = 1e-6  # of the reach: rms of an arm that is the same
AGREE = 1e-9  # of invariants of two arms that are the same
QUARTERS = 90.0  # steps of offsets that are tried [deg]
MOST_WAYS = 20_000  # ways that are tried; of more, only those with half turns
PARALLEL = 1e-6  # sine of the angle between axes that count as parallel
FACTORS = (1.0, -1.0)


def whole_turns(robot: Robot) -> Mask:
    """Mask (n,) of the joints of which a whole turn leaves the arm as it is.

    Joints that turn are of this kind, unless another one slides with them, or turns by a broken
    share of their angle.
    """
    found = ~robot.slides
    if robot.ties is None:
        return found
    P = robot.ties.matrix
    sliding = robot.chain_slides[:, None] & (P != 0)
    broken = (np.abs(P - np.round(P)) > WHOLE_FACTOR) | sliding
    return np.asarray(found & ~broken.any(axis=0))


@dataclass(frozen=True, eq=False)
class SameArm:
    """Another way to count: ``q' = sign q + offset`` describes the same arm.

    Attributes:
        sign: 1 or -1 (n,).
        offset: Offsets (n,) of the joints between the first and the last [rad].
        turn: Rotation (3, 3) of the base frame that goes with it.
    """

    sign: Array
    offset: Array
    turn: Array


def same_arms(robot: Robot, moving: Sequence[int] | None = None) -> tuple[SameArm, ...]:
    """Find the ways to count that no measurement of positions can tell from the robot's own.

    An arm whose base frame and tool are unknown is determined by the motions between its poses,
    ``X_ab = T_a^-1 T_b``, up to one conjugation: by rotations' traces, by the shift along each
    screw axis, and by the same of products. A spherical wrist with its middle joint reversed is the
    classical case: the joints before and after are half a turn away.

    Args:
        robot: The chain.
        moving: Indices of the joints that move; by default all do.

    Returns:
        The ways, the robot's own first: one for each choice of signs, with offsets of quarter
        turns.
    """
    n = robot.n
    moving = list(range(n)) if moving is None else list(moving)
    signs = np.ones((2 ** len(moving), n))
    signs[:, moving] = list(product((1.0, -1.0), repeat=len(moving)))
    offsets = _offsets(robot, moving, MOST_WAYS // len(signs))
    q = _poses(n, moving, 0)
    own = _invariants(robot, q[None])[0]
    found = []
    for sign in signs:
        same = _agree(_invariants(robot, sign * q + offsets[:, None]), own)
        found += [(sign, offset) for offset in offsets[same]]
    sign, offset = (np.array(part) for part in zip(*found, strict=True))
    fits = _fit(robot, sign, offset, moving)
    # The first way is the robot's own, which is the same arm whatever a descent has reached.
    kept = sorted({0, *np.flatnonzero(fits.rms <= SAME_ARM * robot.reach).tolist()})
    first = {tuple(sign[i]): i for i in reversed(kept)}
    turn = fits.turn.copy()
    turn[0] = np.eye(3)
    return tuple(SameArm(sign[i], offset[i], turn[i]) for i in sorted(first.values()))


def _offsets(robot: Robot, moving: list[int], most: int) -> Array:
    """Offsets (o, n) that are tried: quarter turns, or half turns where these are too many.

    Of the first joint and the last one base and tool take up any offset, unless others follow them.
    Where one follows that has the variable c while its master is at zero, the image of both in a
    mirror has an offset of the master of ``-2 c / factor``.
    """
    masters = set() if robot.ties is None else set(_moving_several(robot.ties).tolist())
    between = [
        j
        for j in moving
        if robot.joints[j].kind != "prismatic"
        and (j in masters or j not in (moving[0], moving[-1]))
    ]
    for steps in (4, 2):
        turns = [_turns_of(robot, j, steps) for j in between]
        if np.prod([float(len(one)) for one in turns]) <= most:
            break
    tried = list(product(*turns))
    offsets = np.zeros((len(tried), robot.n))
    offsets[:, between] = tried
    return offsets


def _turns_of(robot: Robot, j: int, steps: int) -> list[float]:
    """Offsets of one joint [rad]; whole turns among them, where these make a difference."""
    first = 0 if whole_turns(robot)[j] else -steps
    last = steps if whole_turns(robot)[j] else steps + 1
    turns = np.deg2rad(np.arange(first, last) * 360 / steps).tolist()
    turns.sort(key=abs)  # the robot's own way comes first
    if robot.ties is None:
        return turns
    factor = robot.ties.matrix[:, j]
    offset = robot.ties.offset
    followers = np.flatnonzero((factor != 0) & (offset != 0))
    return [*turns, *(-2 * offset[followers] / factor[followers]).tolist()]


def _moving_several(ties: Ties) -> Indices:
    """Indices of the drives that move several joints."""
    return np.flatnonzero((ties.matrix != 0).sum(axis=0) > 1)


def _poses(n: int, moving: list[int], seed: int) -> Array:
    """Poses (p, n) in which joints that do not move are at zero."""
    q = np.zeros((TRIAL_POSES, n))
    q[:, moving] = np.random.default_rng(seed).uniform(-2, 2, (TRIAL_POSES, len(moving)))
    return q


def _fit(robot: Robot, sign: Array, offset: Array, moving: list[int]) -> Fits:
    """Fit frame and tool of ways to count (w, n) to markers where the arm itself sees them.

    The invariants are blind for what lies between parallel axes, and for arms that only slide.
    """
    q = _poses(robot.n, moving, 1)
    rng = np.random.default_rng(2)
    markers = robot.reach * rng.uniform(-0.3, 0.3, (MARKERS, 3))
    T = robot.forward(q)
    seen = (T[:, None, :3, :3] @ markers[..., None])[..., 0] + T[:, None, :3, 3]
    names = [str(k) for k in range(MARKERS)] * TRIAL_POSES
    positions = Positions.of_rows(np.repeat(q, MARKERS, axis=0), seen.reshape(-1, 3), names)
    ways = Fits.at(sign[:, :, None] * np.eye(robot.n), offset, MARKERS)
    return descend(robot, place_frames(robot, ways, positions), positions, [], STEPS)


def _agree(invariants: Array, own: Array) -> Mask:
    """Which invariants (b, i) are those of the arm itself (i,)."""
    return np.asarray((np.abs(invariants - own) <= AGREE * (1 + np.abs(own))).all(axis=1))


def _invariants(robot: Robot, q: Array) -> Array:
    """Numbers (b, i) of poses q (b, p, n) that neither base nor tool change."""
    T = robot.forward(q)
    R = T[..., :3, :3]
    first = np.swapaxes(R[:, :1], -1, -2)
    rotation = first @ R[:, 1:]
    shift = (first @ (T[:, 1:, :3, 3] - T[:, :1, :3, 3])[..., None])[..., 0]
    size = max(robot.reach, 1e-12)
    words = [(rotation[:, i], shift[:, i] / size) for i in range(TRIAL_POSES - 1)]
    pairs = [_product(words[i], words[j]) for i in range(TRIAL_POSES - 1) for j in range(i)]
    triple = _product(pairs[0], words[-1])
    return np.concatenate([_of_motion(*word) for word in (*words, *pairs, triple)], axis=1)


def _product(a: tuple[Array, Array], b: tuple[Array, Array]) -> tuple[Array, Array]:
    """One motion after another."""
    return a[0] @ b[0], a[1] + (a[0] @ b[1][..., None])[..., 0]


def _of_motion(rotation: Array, shift: Array) -> Array:
    """Trace, and shift along the axis (b, 2) of motions; a mirror image has the opposite shift."""
    skew = rotation - np.swapaxes(rotation, 1, 2)
    axis = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=-1)
    return np.stack([np.trace(rotation, axis1=1, axis2=2), (axis * shift).sum(axis=-1)], axis=-1)


@dataclass(frozen=True, eq=False)
class WayToCount:
    """Signs of all joints, and perhaps a coupling.

    Attributes:
        sign: 1 or -1 (n,).
        follows: The coupling, if there is one.
    """

    sign: Array
    follows: Follows | None

    @property
    def counting(self) -> Array:
        """The matrix L (n, n) of ``q = L c + o``."""
        n = len(self.sign)
        coupling = np.eye(n)
        if self.follows is not None:
            coupling[self.follows.joint, self.follows.leader] = self.follows.factor
        return np.asarray(self.sign[:, None] * coupling)


def ways_to_count(
    robot: Robot, same: tuple[SameArm, ...], moving: list[int]
) -> tuple[WayToCount, ...]:
    """List all signs and couplings, of those that make the same arm only one.

    Of a joint that stands still nothing can be told: its sign stays 1.

    A joint may follow one before it whose axis is parallel, with parallel axes in between: that is
    where a parallelogram, or the habit of counting against the floor, is found.
    """
    signs: list[Array] = []
    seen: set[tuple[float, ...]] = set()
    by_turned = sorted(product((1.0, -1.0), repeat=robot.n), key=lambda sign: sign.count(-1.0))
    for sign in map(np.array, by_turned):
        still = np.delete(sign, moving)
        if (still > 0).all() and tuple(sign) not in seen:
            signs.append(sign)
            seen |= {_moved(sign * one.sign, moving) for one in same}
    couplings = [one for one in _couplings(robot) if {one.joint, one.leader} <= set(moving)]
    return tuple(WayToCount(sign, follows) for follows in (None, *couplings) for sign in signs)


def _moved(sign: Array, moving: list[int]) -> tuple[float, ...]:
    """Signs with 1 for joints that stand still."""
    return tuple(one if j in moving else 1.0 for j, one in enumerate(sign.tolist()))


def _couplings(robot: Robot) -> list[Follows]:
    """Joints that may follow one before them."""
    frames = robot.frames(np.zeros(robot.n))
    axes = frames.axes if frames.ties is None else frames.axes[frames.ties.free]
    turns = ~robot.slides
    found = []
    for j in range(1, robot.n):
        for leader in reversed(range(j)):
            if not (turns[j] and turns[leader]):
                break
            if np.linalg.norm(np.cross(axes[leader], axes[leader + 1])) > PARALLEL:
                break
            found += [Follows(j, leader, factor) for factor in FACTORS]
    return found


TURNS = 2 * np.pi * np.arange(-2, 3)


@dataclass(frozen=True, eq=False)
class Counted:
    """Signs, zeros and coupling of all joints.

    Attributes:
        names: Names of the joints.
        kinds: "revolute" or "prismatic".
        way: Signs and coupling.
        zero: What the controller shows at the model's zero (n,) [deg or mm].
        rms: Root mean square of the distances that the fit leaves [m].
        outside: How often a joint is beyond its limits.
        tilt: Angle by which the base is turned over beside the best way to count [rad].
    """

    names: tuple[str, ...]
    kinds: tuple[str, ...]
    way: WayToCount
    zero: Array
    rms: float
    outside: int
    tilt: float = 0.0

    @classmethod
    def of(
        cls,
        robot: Robot,
        way: WayToCount,
        offset: Array,
        shown: Array,
        told: list[int],
        rms: float,
    ) -> "Counted":
        """Zeros of offsets o (n,) [rad, m], within the limits where whole turns allow it.

        From ``q = S (I + F) (c - z) = L c + o`` follows ``s_j o_j = -z_j - f z_m``.

        Args:
            robot: Limits and kinds.
            way: Signs and coupling.
            offset: Offsets o (n,) of ``q = L c + o``.
            shown: Poses (p, n) as the controller shows them.
            told: Joints whose zeros are told; the others' poses may be anywhere.
            rms: What the fit leaves [m].
        """
        q = shown @ way.counting.T + offset
        turning = whole_turns(robot)
        zero = np.zeros(robot.n)
        outside = 0
        for j, joint in enumerate(robot.joints):
            turns = TURNS if turning[j] else np.zeros(1)
            of_leader = 0.0
            if way.follows is not None and way.follows.joint == j:
                of_leader = way.follows.factor * zero[way.follows.leader]
            zeros = -way.sign[j] * (offset[j] + turns) - of_leader
            lower, upper = joint.limits
            values = q[:, j] + turns[:, None]
            beyond = ((values < lower) | (values > upper)).sum(axis=1) if j in told else turns * 0
            chosen = int(np.lexsort((np.abs(zeros), beyond))[0])
            zero[j] = zeros[chosen]
            outside += int(beyond[chosen])
        kinds = tuple("prismatic" if j.kind == "prismatic" else "revolute" for j in robot.joints)
        shown_zero = np.round(zero / robot.units, DIGITS) + 0.0
        return cls(robot.joint_names, kinds, way, shown_zero, rms, outside)

    @property
    def order(self) -> tuple[float, ...]:
        """Of equal ways comes first that within the limits, then that with small zeros."""
        turned = int((self.way.sign < 0).sum())
        return (self.outside, round(float(np.abs(self.zero).sum())), turned)

    def table(self) -> dict[str, Any]:
        """The keys of a table `controller`."""
        found: dict[str, Any] = {}
        sign = {name: -1 for name, one in zip(self.names, self.way.sign, strict=True) if one < 0}
        if sign:
            found["sign"] = sign
        for key, kind in (("zero_deg", "revolute"), ("zero_mm", "prismatic")):
            rows = zip(self.names, self.kinds, self.zero.tolist(), strict=True)
            zero = {name: value for name, own, value in rows if own == kind and value}
            if zero:
                found[key] = zero
        if self.way.follows is not None:
            one = self.way.follows
            leader: Any = self.names[one.leader]
            if one.factor != 1:
                leader = {"joint": leader, "factor": int(one.factor)}
            found["follows"] = {self.names[one.joint]: leader}
        return found

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers: the table, what it leaves [m], and poses beyond the limits."""
        return {
            "controller": self.table(),
            "rms": self.rms,
            "outside_limits": self.outside,
            "base_tilt": self.tilt,
        }
