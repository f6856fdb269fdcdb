"""The feasible set of poses: the intersection of constraints, and poses around a test pose."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from edtk.robots.constraints.constraint import Constraint, Inequality
from edtk.robots.constraints.joint_limits import CoupledLimits, JointLimits
from edtk.robots.joint import Coupling
from edtk.robots.robot import Bounds, Robot
from edtk.system.typing import Array, Mask

PAIRS = 127  # pairs of mirrored poses; with the test pose itself, 255 poses
# Of all generators of a lattice of 127 points that have the full order 126, this one leaves the
# least correlation between joints: at most 0.08 for up to eight of them, where random points have
# about 0.2.
GENERATOR = 45
MOST_NAMED = 4  # rows of a joint


@dataclass(frozen=True)
class Violation:
    """An inequality that a pose breaks.

    Attributes:
        inequality: Its name and unit.
        amount: By how much it is broken [m or rad], positive.
    """

    inequality: Inequality
    amount: float

    def __str__(self) -> str:
        unit = self.inequality.unit
        return f"'{self.inequality.label}' by {self.amount * unit.per_si:.3g} {unit.name}"


@dataclass(frozen=True, eq=False)
class Workspace:
    """The intersection of constraints, for one robot; batch first for callers.

    Args:
        robot: The chain whose tool point and frame are constrained.
        constraints: Constraints besides the robot's joint limits, which always hold.
    """

    robot: Robot
    constraints: tuple[Constraint, ...] = ()

    @property
    def beside_limits(self) -> tuple[Constraint, ...]:
        """All but the limits of single drives: the given ones, and those of coupled joints."""
        if not any(one.limits for one in self.robot.couplings):
            return self.constraints
        return (*self.constraints, CoupledLimits(self.robot.bounds.coupled))

    @property
    def everything(self) -> tuple[Constraint, ...]:
        """The given constraints, and the joint limits."""
        return (*self.beside_limits, JointLimits(self.robot.hard_limits))

    @property
    def inequalities(self) -> tuple[Inequality, ...]:
        """Name and unit of each inequality (c,)."""
        return tuple(
            inequality
            for constraint in self.everything
            for inequality in constraint.inequalities(self.robot)
        )

    @property
    def labels(self) -> tuple[str, ...]:
        """Name of each inequality (c,)."""
        return tuple(inequality.label for inequality in self.inequalities)

    def violations(self, slack: Array, tolerance: float = 1e-9) -> tuple[Violation, ...]:
        """Inequalities that one pose breaks.

        Args:
            slack: Slacks (c,) of the pose [m or rad].
            tolerance: Slacks down to minus this count as rounding [m or rad].
        """
        return tuple(
            Violation(inequality, -float(value))
            for inequality, value in zip(self.inequalities, slack, strict=True)
            if value < -tolerance
        )

    def slack(self, q: ArrayLike) -> Array:
        """All slacks (..., c) of the poses q (..., n) [m or rad]; negative ones are violations."""
        frames = self.robot.frames(q)
        slacks = [constraint.slack(frames) for constraint in self.everything]
        return np.moveaxis(np.concatenate(slacks), 0, -1)

    def gradient(self, q: ArrayLike) -> Array:
        """Derivative (..., c, n) of the slacks with respect to the joint variables."""
        frames = self.robot.frames(q)
        gradients = [constraint.gradient(frames) for constraint in self.everything]
        return np.moveaxis(np.concatenate(gradients), (0, 1), (-2, -1))

    def contains(self, q: ArrayLike) -> Mask:
        """Whether each pose (..., n) satisfies every constraint."""
        return np.asarray((self.slack(q) >= 0).all(axis=-1))

    def slack_within(self, q: ArrayLike, resolution: ArrayLike) -> Array:
        """Slacks (..., c) at the best pose within rounding, to first order.

        A pose that was rounded to `resolution` may have been feasible before: each slack is raised
        by ``sum_k |d slack/dq_k| resolution_k/2``, the most that rounding can have taken from it.

        Args:
            q: Joint variables (..., n), rounded [rad or m].
            resolution: Step of the rounding, one number or one a joint (n,) [rad or m].
        """
        return self.slack(q) + (np.abs(self.gradient(q)) * np.asarray(resolution) / 2).sum(axis=-1)


def neighbourhood(robot: Robot, q: Array, within: float) -> Array:
    """Spread poses evenly over the neighbourhood of a test pose, always the same ones.

    A revolute joint moves by at most `within` to either side, and a prismatic joint by the share
    ``within / 2 pi`` of its range; joint limits cut both. The box that is left is filled by
    Korobov's lattice, which is more even than random points: point i = 1 .. 127 has the share
    ``u_ij = ((i 45^(j-1) mod 127) + 1/2) / 127`` of the way for joint j = 1 .. n. Each point comes
    with its mirror image 1 - u, which makes the mean of everything linear exact. A pose in which a
    joint that is coupled is beyond its own limits is drawn back to the nearest one within, on the
    straight line to the test pose.

    Args:
        robot: The chain, with its limits.
        q: The test pose (n,) [rad or m].
        within: Largest turn of a joint [rad].

    Returns:
        Poses (255, n) [rad or m], the test pose first.
    """
    travel = np.array(
        [
            within if joint.kind == "revolute" else within / (2 * np.pi) * np.ptp(joint.limits)
            for joint in robot.joints
        ]
    )
    lower, upper = robot.hard_limits
    # A test pose beyond a limit stays in its own neighbourhood.
    low = np.minimum(q, np.maximum(lower, q - travel))
    high = np.maximum(q, np.minimum(upper, q + travel))
    steps = np.array([pow(GENERATOR, j, PAIRS) for j in range(robot.n)])
    u = (np.arange(1, PAIRS + 1)[:, None] * steps % PAIRS + 0.5) / PAIRS
    poses = np.concatenate([q[None], low + (high - low) * u, high - (high - low) * u])
    return _drawn_back(robot.bounds.coupled, q, poses)


def _drawn_back(bounds: Bounds, q: Array, poses: Array) -> Array:
    """Poses (N, n), as near to a pose q (n,) on straight lines as bounds want it.

    A bound that q is beyond is where q is.
    """
    at, reach = bounds.values(q), bounds.values(poses - q)
    lower, upper = bounds.limits
    room = np.where(reach > 0, np.maximum(upper - at, 0.0), np.maximum(at - lower, 0.0))
    beyond = np.abs(reach) > room
    share = np.divide(room, np.abs(reach), out=np.ones_like(reach), where=beyond)
    back = share.min(axis=1, initial=1.0)
    moved = back < 1
    found = poses.copy()
    found[moved] = q + back[moved, None] * (poses[moved] - q)
    return found


ON_LIMIT = {"revolute": np.deg2rad(0.05), "prismatic": 5e-5}  # [rad, m], as people read a display


def within_margin(robot: Robot, margin: dict[str, float], fixed: frozenset[int]) -> Robot:
    """The same chain, whose moving joints stay away from their limits.

    Joints without limits have no margin, and neither have joints that stay where they are.

    Args:
        robot: The chain.
        margin: Distance from each limit by kind of joint [rad, m].
        fixed: Indices of joints that do not move.

    Raises:
        ValueError: A joint has no range left; names it.
    """
    limits = {}
    for j, joint in enumerate(robot.joints):
        by = margin.get(joint.kind, 0.0)
        if not by or joint.continuous or j in fixed:
            continue
        lower, upper = joint.limits
        if not upper - lower > 2 * by:
            raise ValueError(f"leaves no range for joint {joint.name!r}")
        limits[joint.name] = (lower + by, upper - by)
    couplings = tuple(_within(one, margin["revolute"]) for one in robot.couplings)
    return replace(robot.with_limits(limits), couplings=couplings)


def _within(coupling: Coupling, margin: float) -> Coupling:
    """The same coupling, whose joint stays away from its own limits too.

    Raises:
        ValueError: It has no range left.
    """
    if coupling.limits is None:
        return coupling
    lower, upper = coupling.limits
    if not upper - lower > 2 * margin:
        raise ValueError(f"leaves no range for joint {coupling.joint!r} itself")
    return replace(coupling, limits=(lower + margin, upper - margin))


def joints_on_limits(
    robot: Robot, q: Array, fixed: frozenset[int] = frozenset()
) -> dict[str, list[int]]:
    """Which rows of poses (k, n) [rad or m] have a joint on its limit, by joint; from 0.

    Args:
        robot: The chain, with the limits at which its joints stop.
        q: The poses.
        fixed: Indices of joints that do not move, and do not count.
    """
    bounds = robot.bounds
    lower, upper = bounds.limits
    values = bounds.values(q)
    near = np.array([ON_LIMIT[robot.joints[j].kind] for j in bounds.of])
    there = (values - lower < near) | (upper - values < near)
    moving = np.flatnonzero(np.delete(bounds.rows, list(fixed), axis=1).any(axis=1))
    return {
        name: np.flatnonzero(there[:, row]).tolist()
        for row, name in enumerate(bounds.names)
        if row in moving and there[:, row].any()
    }


def on_limits_in_words(found: dict[str, list[int]]) -> str:
    """Which joints stand on their limits in which rows, counted from 1; empty for none."""
    if not found:
        return ""
    parts = []
    for name, rows in found.items():
        more = f" and {len(rows) - MOST_NAMED} more" if len(rows) > MOST_NAMED else ""
        plural = "s" * (len(rows) > 1)
        listed = ", ".join(str(row + 1) for row in rows[:MOST_NAMED])
        parts.append(f"{name} in row{plural} {listed}{more}")
    return f"on their limits: {'; '.join(parts)} ([joints] margin_deg keeps plans away from limits)"
