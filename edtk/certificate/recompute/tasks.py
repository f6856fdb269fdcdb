"""The tasks of a certificate, the poses around them, and the targets that follow."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from edtk.certificate.recompute.chain import Chain, Gives
from edtk.certificate.recompute.geometry import Geometry
from edtk.certificate.recompute.physics import (
    Friction,
    Physics,
    Place,
    Weight,
    loads,
    read_weights,
    regressors,
)
from edtk.certificate.recompute.plain_data import in_range, number, numbers, rows, table
from edtk.system.typing import Array

LEVELS = 127  # of each joint; a prime
LEVEL_STEP = 45  # from one joint's order of the levels to the next joint's
DEPENDENT = 1e-10  # least singular value of independent combinations of length one
WHERE = "setting.test_pose"
MOST_TASKS = 10_000
MOST_TASK_NUMBERS = 3e7  # of all tasks' rows and of what they are computed from
NEAR_POSES = 255  # of a neighbourhood
OVERHEAD = 20  # poses that take as long as what a task takes besides
LONGEST_LEVER = 1e3  # of rotations that count as displacements [m]
# What the weights of the tasks are rounded down by, beside their sum: more than rounding.
ROUNDING = 1e-14


def neighbourhood(chain: Chain, q: Array, within: float) -> Array:
    """Poses (255, n) whose joints are within an angle of the test pose q (n,), itself the first.

    They are the points of a lattice in the box ``[lower, upper]`` and their mirror images in turn.
    Each joint takes 127 levels once: point i has level i for the first joint, and for each further
    joint 45 times the level of the joint before, modulo 127. A step from the test pose by which a
    coupled joint would pass its own limits is shortened until it ends there.

    Args:
        chain: The robot, whose limits cut the box.
        q: The test pose [rad or m].
        within: Largest turn [rad]; a prismatic joint moves by ``within / 2 pi`` of its range.
    """
    ranges = chain.limits[1] - chain.limits[0]
    most = np.where(chain.prismatic, ranges * within / (2 * np.pi), within)
    # The test pose belongs to the box even where it is beyond a limit.
    lower = np.minimum(np.clip(q - most, chain.ends[0], None), q)
    upper = np.maximum(np.clip(q + most, None, chain.ends[1]), q)
    poses = [q]
    for i in range(LEVELS):
        levels = [i]
        while len(levels) < len(q):
            levels.append(levels[-1] * LEVEL_STEP % LEVELS)
        share = (np.array(levels) + 0.5) / LEVELS
        poses.append(lower * (1 - share) + upper * share)
        poses.append(lower * share + upper * (1 - share))
    sums, (least, most) = chain.coupled
    for row, low, high in zip(sums, least, most, strict=True):
        own = row @ q
        for i, pose in enumerate(poses):
            step = row @ (pose - q)
            room = max(high - own, 0.0) if step > 0 else max(own - low, 0.0)
            if abs(step) > room:
                poses[i] = q + room / abs(step) * (pose - q)
    return np.array(poses)


EPS = float(np.finfo(float).eps)


def combinations(value: Any, p: int, where: str) -> Array:
    """Combinations K (p, s), one a column.

    Raises:
        ValueError: They are not finite, or depend on each other.
    """
    K = numbers(value, (p, None), where)
    if not 0 < K.shape[1] <= p or not np.abs(K).max(axis=0).all():
        raise ValueError(f"{where}: expected from one to {p} columns, none of them zero")
    if np.linalg.svd(K / np.linalg.norm(K, axis=0), compute_uv=False)[-1] < DEPENDENT:
        raise ValueError(f"{where}: a column follows from the others")
    return K


@dataclass(frozen=True, eq=False)
class CovarianceRoot:
    """W with ``W W'`` the covariance of the parameters that whitened rows tell.

    With columns of unit length, ``stacked / d = U S V'``, it is ``V S^-1 / d`` over the singular
    values that are more than rounding.

    Attributes:
        W: The root (p, r).
        s: The singular values (r,), descending.
        d: Lengths (p,) of the columns.
        hidden: The other directions (q, p), for parameters in units of d.
    """

    W: Array
    s: Array
    d: Array
    hidden: Array

    @classmethod
    def of(cls, stacked: Array) -> "CovarianceRoot":
        """From rows (N, p)."""
        length = np.linalg.norm(stacked, axis=0)
        is_some = length > len(stacked) * EPS * length.max()
        d = np.where(is_some, length, 1.0)
        unit = np.where(is_some, stacked, 0.0) / d
        # Rows of zeros make V square; to ask for a square one would make U (N, N), too.
        unit = np.pad(unit, ((0, max(unit.shape[1] - len(unit), 0)), (0, 0)))
        _, s, V = np.linalg.svd(unit, full_matrices=False)
        # Rows have half the digits of their squares to lose; M itself is singular at 16 p eps.
        is_known = s > 4 * np.sqrt(len(d) * EPS)
        return cls(V[is_known].T / s[is_known] / d[:, None], s[is_known], d, V[~is_known])

    def tells(self, K: Array, rounded: Array | float = 0.0) -> bool:
        """Whether combinations (p, s) have no part in the other directions, beyond rounding.

        Args:
            K: The combinations.
            rounded: What their last digits make of each entry, beside its own.
        """
        scaled = K / self.d[:, None]
        outside = np.abs(self.hidden @ scaled).max(axis=0, initial=0.0)
        least = self.s.min(initial=1.0)
        allowed = 64 * len(self.d) * EPS / least**2 * np.linalg.norm(scaled, axis=0)
        digits = np.abs(self.hidden) @ np.broadcast_to(rounded / self.d[:, None], K.shape)
        allowed = allowed + digits.max(axis=0, initial=0.0)
        return bool(len(self.s) and (outside <= allowed).all())


def deviations(stacked: Array, K: Array) -> Array | None:
    """L (s, r) with ``L L'`` the covariance of K'k, by whitened rows (N, p); None if it is open."""
    root = CovarianceRoot.of(stacked)
    return np.asarray(K.T @ root.W) if root.tells(K) else None


@dataclass(frozen=True, eq=False)
class Tasks:
    """Where the robot shall be accurate.

    Attributes:
        each: A matrix (r, p) for each task: the squares of its rows are the harm.
        weights: Shares (tasks,) of the tasks in rho0, of sum one.
    """

    each: list[Array]
    weights: Array

    @classmethod
    def from_content(
        cls,
        content: Any,
        robot: Any,
        unknown: list[int],
        gives: Gives | None = None,
        friction: Friction | None = None,
    ) -> "Tasks":
        """Read the part `setting.test_pose`: nothing, a task, or a list of tasks.

        Args:
            content: The part.
            robot: The part `setting.robot`, which has the chain.
            unknown: Indices (p,) of the joints whose compliances are the parameters.
            gives: How joints with compensators give way; None without any.
            friction: What friction of these joints holds; None where it counts for nothing.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        if content is None:
            return cls([], np.empty(0))
        of = (robot, unknown, gives, friction)
        p = len(unknown) * (1 if friction is None else 2)
        _require_few(content, len(Chain.from_dict(robot).axes), p)
        if not isinstance(content, list):
            return cls([_harm(content, *of, WHERE)], np.ones(1))
        places = [f"{WHERE}.{i}" for i in range(len(rows(content, MOST_TASKS, WHERE)))]
        each = [_harm(task, *of, place) for task, place in zip(content, places, strict=True)]
        return cls(each, _shares(content, places))

    @classmethod
    def of_geometry(
        cls, content: Any, robot: Any, chain: Chain, physics: Physics, geometry: Geometry
    ) -> "Tasks":
        """Read the tasks of a study of geometry, in which parameters of markers count, too.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        if content is None:
            return cls([], np.empty(0))
        places = [f"{WHERE}.{i}" for i in range(len(rows(content, MOST_TASKS, WHERE)))]
        _require_few(content, len(chain.axes), geometry.p, len(physics.sensors))
        each = [
            _geometric_harm(task, robot, physics, geometry, place)
            for task, place in zip(content, places, strict=True)
        ]
        return cls(each, _shares(content, places))

    def targets(self, name: str) -> list[Array]:
        """The targets of which a criterion is the worst: each task's, or one of all for rho0."""
        if not self.each:
            return []
        if name == "rho_max":
            return [A for A, weight in zip(self.each, self.weights, strict=True) if weight > 0]
        return [self._mean(self.weights)]

    def proving(self, name: str, weights: Any, r: int) -> list[Array]:
        """The target to each of r multipliers, see `lower_bound`; empty for other criteria.

        Args:
            name: The criterion.
            weights: What the certificate has in the place of the weights of the tasks, which prove
                a bound of rho_max whatever they are, as long as they are shares of one.
            r: Number of multipliers.

        Raises:
            ValueError: The weights of the tasks are no such numbers.
        """
        if name == "rho0" and self.each:
            return self.targets(name) * r
        if name != "rho_max" or not self.each:
            return []
        rows(weights, r, "proof.task_weights")
        found = numbers(weights, (r, len(self.each)), "proof.task_weights")
        # A task that the design does not weigh is no part of the worst.
        total = found.sum(axis=1, keepdims=True)
        if not (found >= 0).all() or not (total > 0).all() or found[:, self.weights == 0].any():
            raise ValueError("proof.task_weights: expected shares of the tasks that have weight")
        return [self._mean(shares) for shares in found / total * (1 - ROUNDING)]

    def _mean(self, shares: Array) -> Array:
        """Rows (r, p) whose squares are the mean of the tasks' harms."""
        parts = [np.sqrt(share) * A for share, A in zip(shares, self.each, strict=True) if share]
        return np.concatenate(parts)


def _require_few(content: Any, joints: int, p: int, instruments: int = 1) -> None:
    """Check, before any is computed, that the rows of all tasks fit into memory.

    Raises:
        ValueError: They do not.
    """
    tasks = content if isinstance(content, list) else [content]
    near = any(isinstance(task, dict) and task.get("within") for task in tasks)
    each = (NEAR_POSES if near else OVERHEAD) * instruments * 6 * (joints + p)
    if len(tasks) * each > MOST_TASK_NUMBERS:
        raise ValueError(f"{WHERE}: {len(tasks)} tasks have more rows than are computed here")


def _shares(content: list[Any], places: list[str]) -> Array:
    """Weights of the tasks, divided by their sum.

    Raises:
        ValueError: They are none.
    """
    given = zip(content, places, strict=True)
    weights = np.array([number(task.get("weight", 1.0), place) for task, place in given])
    if not (weights >= 0).all() or not weights.any():
        raise ValueError(f"{WHERE}: expected weights that are not negative, and not all zero")
    return np.asarray(weights / weights.sum())


@dataclass(frozen=True, eq=False)
class _Place:
    """What tasks of all kinds say.

    Attributes:
        chain: The robot with the task's tool.
        poses: The pose (1, n), or all of its neighbourhood [rad or m].
        wrench: The load (poses, 6) in each [N, N m].
        lever: Distance at which rotations count [m].
        weights: What loads the joints besides; None where the task does not say.
    """

    chain: Chain
    poses: Array
    wrench: Array
    lever: float
    weights: list[Weight] | None

    @classmethod
    def of(cls, task: dict[str, Any], robot: Any, where: str) -> "_Place":
        """Read a task.

        Raises:
            ValueError: A part is not what it should be.
        """
        chain = Chain.from_dict(robot | ({"tool": task["tool"]} if "tool" in task else {}))
        q = numbers(task["q"], (chain.n,), f"{where}.q")
        wrench = numbers(task["wrench"], (6,), f"{where}.wrench")
        within = number(task.get("within", 0.0), f"{where}.within")
        lever = number(task.get("lever", 0.0), f"{where}.lever")
        if not 0 <= within <= np.pi or not 0 <= lever <= LONGEST_LEVER:
            raise ValueError(
                f"{where}: expected an angle within half a turn, and a lever in metres"
            )
        poses = neighbourhood(chain, q, within) if within else q[None]
        weights = None
        if "weights" in task:
            weights = read_weights(task["weights"], len(chain.axes), f"{where}.weights")
        return cls(chain, poses, np.tile(wrench, (len(poses), 1)), lever, weights)

    def mean(self, positions: Array, turns: Array) -> Array:
        """Rows (r, p) whose squares are the mean harm over the poses.

        Args:
            positions: Rows (poses, r, p) of positions [m].
            turns: Rows (poses, 3, p) of rotations, which count with the lever [rad].
        """
        each = np.concatenate([positions, self.lever * turns], axis=1) if self.lever else positions
        return in_range(np.concatenate(each) / np.sqrt(len(self.poses)), WHERE)


OPTIONAL = ("within", "lever", "weight", "weights")


def _harm(
    content: Any,
    robot: Any,
    unknown: list[int],
    gives: Gives | None,
    friction: Friction | None,
    where: str,
) -> Array:
    """Rows (r, p) of a task with its tool: their squares are the harm.

    For a test pose alone it is the regressor A0. Over a neighbourhood it has the rows of all its
    poses, divided by the root of their number. Rotation rows count with the lever, if there is one.
    Joints are where the load acts, and a part of each column is left with compensators.
    """
    task = table(content, ("q", "tool", "wrench"), where, OPTIONAL)
    at = _Place.of(task, robot, where)
    A = regressors(at.chain, unknown, at.poses, at.wrench, at.weights or [])
    if gives is not None:
        A = A * gives.factors(at.chain, at.poses)[:, None, unknown]
    if friction is not None:
        A = friction.beside(A, loads(at.chain, unknown, at.poses, at.wrench, at.weights or []))
    return at.mean(A[:, :3], A[:, 3:])


def _geometric_harm(
    content: Any, robot: Any, physics: Physics, geometry: Geometry, where: str
) -> Array:
    """The same by geometry and springs.

    A task with a tool is about its tool point, which the task's wrench and weights load. One
    without is about the k markers on it, ``|A0 d|^2 = sum_k |x_k|^2 / k``, and is loaded as a visit
    is, unless it has weights of its own.
    """
    task = table(content, ("q", "wrench", "weight"), where, (*OPTIONAL, "tool"))
    at = _Place.of(task, robot, where)
    geometry = replace(geometry, changes=False, brought=True)
    if at.weights is not None or "tool" in task:
        physics = replace(physics, weights=at.weights or [])
        geometry = replace(geometry, payload=[])
    if "tool" in task:
        physics = replace(physics, load_point=Place(np.zeros(3), None))
    of_tool = geometry.of_tool(at.chain, physics, at.poses, at.wrench)
    if "tool" in task:
        return at.mean(of_tool[:, :3], of_tool[:, 3:])
    A = physics.positions(geometry.rows(at.chain, physics, at.poses, at.wrench))
    if not A.shape[1]:
        raise ValueError(f"{where}: expected a tool, as no marker sits on it")
    return at.mean(A / np.sqrt(A.shape[1] // 3), of_tool[:, 3:])
