"""Inverse kinematics of any serial chain: joints at which the tool stands in a given place."""

from dataclasses import dataclass

import numpy as np

from edtk.robots.joint import AT_LIMIT
from edtk.robots.robot import Robot
from edtk.robots.rotations import rotation, rotation_vector, vector_product
from edtk.system.typing import Array, Mask

STARTS = 96  # from which Newton's method sets out at once; an arm of six axes has 16 solutions
STEPS = 80  # of Newton's method; twelve are the rule, more where a wrist is stretched
LONGEST = 0.5  # [rad or m] of a joint in one step; beyond, the derivative says nothing
DAMPING = 0.5  # of the squared error, in the normal equations (Sugihara, IEEE TRO 27, 2011)
FLOOR = 1e-12  # of the damping, at which a singular arm still has a step
REACHED = 1e-9  # [m, rad] by which a solution may be off
SETTLED = 1e-12  # [m, rad] at which nothing is left to gain
SAME = 1e-4  # [rad or m] by which two solutions are one
TURN = 2 * np.pi
AXES = 6


@dataclass(frozen=True, eq=False)
class Solutions:
    """All joint variables that were found for one place of the tool.

    Attributes:
        q: Solutions (s, n) within the limits, turns of 360 degrees counted apart [rad or m].
        beyond: Whether there are others that are beyond the limits.
    """

    q: Array
    beyond: bool

    def nearest(self, start: Array) -> Array | None:
        """The solution (n,) whose largest joint motion from a start (n,) is least; None of none."""
        if not len(self.q):
            return None
        return np.asarray(self.q[np.argmin(np.abs(self.q - start).max(axis=1))])


def solve(robot: Robot, goals: Array, starts: Array) -> tuple[Array, Mask]:
    """Bring the tool to places by a damped Newton's method, each from a start of its own.

    With the error ``e = (x - p(q), log(R R(q)'))`` and the Jacobian J, a step is
    ``J' (J J' + lambda I)^-1 e`` with ``lambda = |e|^2 / 2 + floor`` (Levenberg and Marquardt with
    Sugihara's damping): far away it is a short way downhill, and near the goal Newton's own, also
    where J is singular. Lengths count in metres, angles in radians.

    Args:
        robot: The chain with its tool.
        goals: Places of the tool frame (m, 4, 4) in the world [m].
        starts: Joint variables (m, n) [rad or m].

    Returns:
        Joint variables (m, n), limits not counted, and whether each reaches its goal (m,) to 1e-9.
    """
    q = np.array(starts, dtype=float)
    size = np.full(len(q), np.inf)
    moving = np.arange(len(q))
    for _ in range(STEPS):
        error, J = _error(robot, q[moving], goals[moving])
        size[moving] = np.linalg.norm(error, axis=-1)
        going = size[moving] > SETTLED
        moving, error, J = moving[going], error[going], J[going]
        if not len(moving):
            break
        damping = DAMPING * np.square(error).sum(axis=-1) + FLOOR
        A = J @ np.swapaxes(J, -1, -2) + damping[:, None, None] * np.eye(6)
        step = np.einsum("mrn,mr->mn", J, np.linalg.solve(A, error[..., None])[..., 0])
        longest = np.abs(step).max(axis=-1, keepdims=True)
        q[moving] += step * np.minimum(1.0, LONGEST / np.maximum(longest, SETTLED))
    return q, size < REACHED


def _error(robot: Robot, q: Array, goals: Array) -> tuple[Array, Array]:
    """What is left to the goals (m, 6) [m, rad], and the Jacobians (m, 6, n)."""
    frames = robot.frames(q)
    J = np.moveaxis(np.concatenate([frames.linear, frames.angular], axis=1), (0, 1), (-1, -2))
    turn = np.einsum("mik,kjm->ijm", goals[:, :3, :3], frames.rotation)
    apart = goals[:, :3, 3] - frames.position.T
    return np.concatenate([apart, rotation_vector(turn).T], axis=1), J


def solutions(robot: Robot, goal: Array, start: Array | None = None, seed: int = 0) -> Solutions:
    """Find the joints at which the tool stands in a place, on all branches.

    Newton's method sets out from a start, from poses that are drawn within the limits, and again
    from the mirror images of what it has found: with the first axis or the wrist turned by half.

    Args:
        robot: The chain with its tool.
        goal: Place of the tool frame (4, 4) in the world [m].
        start: Joint variables (n,) that may be near; None for none.
        seed: Of the poses that are drawn.
    """
    low, high = _drawn_limits(robot)
    drawn = np.random.default_rng(seed).uniform(low, high, (STARTS, robot.n))
    first = drawn if start is None else np.concatenate([start[None], drawn])
    found = _reached(robot, goal, first)
    if len(found) and robot.n >= 4:
        found = np.concatenate([found, _reached(robot, goal, _mirrored(found))])
    within = _turned(robot, found)
    good = robot.bounds.excess(within).max(axis=-1, initial=-np.inf) <= AT_LIMIT
    return Solutions(within[good], len(found) > 0 and not good.any())


def is_nearest(robot: Robot, q: Array, start: Array) -> bool:
    """Whether no solution of the same place can be nearer to a start than this one.

    Between two solutions ``q`` and ``q + d`` the tool moves by ``J d`` and at most ``L |d|^2 / 2``
    more, and in all by nothing: ``|d| >= 2 s / L`` with the least singular value s of J. With n
    joints and the reach r, second derivatives are at most ``hypot(1, r)`` each, and turns compose
    to their sum up to half of its square, so that ``L = 2 n hypot(1, r)`` is enough. Then no other
    solution is nearer, in the largest joint motion, if that of q is at most
    ``(2 s / L - |q - start|) / sqrt(n)``. Chains with joints to spare have others everywhere.

    Args:
        robot: The chain with its tool.
        q: A solution (n,) [rad or m].
        start: Joint variables (n,).
    """
    if robot.n > AXES:
        return False
    s = float(np.linalg.svd(robot.jacobian(q), compute_uv=False)[-1])
    L = 2 * robot.n * float(np.hypot(1.0, robot.reach))
    apart = q - start
    least = (2 * s / L - float(np.linalg.norm(apart))) / np.sqrt(robot.n)
    return float(np.abs(apart).max()) <= least


def _drawn_limits(robot: Robot) -> Array:
    """Limits (2, n) of poses that are drawn: one turn of a joint is enough."""
    low, high = robot.limits
    turned = np.array([np.maximum(low, -np.pi), np.minimum(high, np.pi)])
    turned = np.where(turned[0] < turned[1], turned, [low, high])
    return np.asarray(np.where(robot.slides, [low, high], turned))


def _reached(robot: Robot, goal: Array, starts: Array) -> Array:
    """Solutions (s, n) from some starts, each once, revolute joints between -180 and 180 deg."""
    q, good = solve(robot, np.broadcast_to(goal, (len(starts), 4, 4)), starts)
    q = np.where(~robot.slides & (robot.ties is None), q - TURN * np.round(q / TURN), q)[good]
    return _once(q)


def _once(q: Array) -> Array:
    """Poses (s, n), of those that are nearly the same the first."""
    kept: list[Array] = []
    for one in q:
        if not kept or np.abs(np.array(kept) - one).max(axis=1).min() > SAME:
            kept.append(one)
    return np.array(kept).reshape(-1, q.shape[1])


def _mirrored(q: Array) -> Array:
    """Poses (2 s, n) that are near other branches: the first axis, or the wrist, turned by half."""
    turned = q.copy()
    turned[:, 0] += np.pi
    flipped = q.copy()
    flipped[:, -3:] = q[:, -3:] * [1, -1, 1] + [np.pi, 0, np.pi]
    return np.concatenate([turned, flipped])


def _turned(robot: Robot, q: Array) -> Array:
    """All poses (s, n) that differ from some by whole turns of joints, within one turn of limits.

    Joints that are coupled by their drives are left as they are: a turn of one moves others.
    """
    if robot.ties is not None:
        return _once(q)
    for j, joint in enumerate(robot.joints):
        low, high = joint.limits
        if joint.kind == "prismatic":
            continue
        if joint.continuous or high - low < TURN:
            q = q.copy()
            q[:, j] += TURN * np.round(((low + high) / 2 - q[:, j]) / TURN)
            continue
        each = []
        for turn in (-TURN, 0.0, TURN):
            other = q.copy()
            other[:, j] += turn
            each.append(other[(low - AT_LIMIT <= other[:, j]) & (other[:, j] <= high + AT_LIMIT)])
        q = np.concatenate(each) if any(map(len, each)) else q
    return _once(q)


@dataclass(frozen=True)
class Posture:
    """On which side of its singular places an arm of six axes stands, as makers tell branches.

    The wrist point is that of the fifth axis which is nearest to the fourth one.

    Attributes:
        shown: What the controller shows of the joints (n,) [rad or m].
        ahead: How far the wrist point is ahead of the first axis, in the direction that the arm has
            where the controller shows zero for it [m].
        elbow: How the distance of the wrist point from the second axis grows with the third one, as
            the controller counts it [m/rad]; zero where the elbow is stretched.
    """

    shown: tuple[float, ...]
    ahead: float
    elbow: float

    @classmethod
    def of(cls, robot: Robot, q: Array) -> "Posture | None":
        """The posture in joints q (n,); None of a chain that is no arm of six turning axes."""
        shown = robot.shown(q)
        turning = all(joint.kind == "revolute" for joint in robot.chain)
        if robot.n != AXES or len(robot.chain) != AXES or not turning:
            return None
        frames = robot.frames(q)
        axes, origins = frames.axes, frames.origins
        wrist = _nearest_point(origins[4], axes[4], origins[3], axes[3])
        zero = shown.copy()
        zero[0] = 0.0
        turned = float(robot.of_shown(zero)[0] - q[0])
        ahead = rotation(turned * axes[0]) @ (wrist - origins[0])
        change = np.zeros(AXES)
        change[2] = 1e-6
        along = (robot.of_shown(shown + change) - robot.of_shown(shown)) / 1e-6
        moved = along[2] * vector_product(axes[2], wrist - origins[2])
        arm = wrist - origins[1]
        arm = arm - axes[1] * (axes[1] @ arm)
        elbow = float(arm @ moved / max(float(np.linalg.norm(arm)), SETTLED))
        return cls(tuple(map(float, shown)), float(ahead @ robot.base[:3, 0]), elbow)


def _nearest_point(origin: Array, axis: Array, other: Array, direction: Array) -> Array:
    """The point of one axis that is nearest to another; its origin where both are parallel."""
    normal = vector_product(axis, direction)
    size = float(normal @ normal)
    if size < AT_LIMIT:
        return origin
    apart = other - origin
    along = float(vector_product(apart, direction) @ normal) / size
    return np.asarray(origin + along * axis)
