"""The tasks of a certificate, and the targets that follow from them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.certificate.recompute.chain import Chain
from edtk.certificate.recompute.geometry import Geometry
from edtk.certificate.recompute.neighbourhood import neighbourhood
from edtk.certificate.recompute.physics import Physics, read_weights
from edtk.certificate.recompute.plain_data import number, numbers, rows, table
from edtk.certificate.recompute.regressors import regressors
from edtk.system.typing import Array

WHERE = "setting.test_pose"
MOST_TASKS = 10_000
MOST_NUMBERS = 3e7  # of all tasks' rows and of what they are computed from
NEAR_POSES = 255  # of a neighbourhood
OVERHEAD = 20  # poses that take as long as what a task takes besides
LONGEST_LEVER = 1e3  # of rotations that count as displacements [m]
# What the weights of the tasks are rounded down by, beside their sum: more than rounding.
ROUNDING = 1e-14


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
    def from_content(cls, content: Any, robot: Any, unknown: list[int]) -> "Tasks":
        """Read the part `setting.test_pose`: nothing, a task, or a list of tasks.

        Args:
            content: The part.
            robot: The part `setting.robot`, which has the chain.
            unknown: Indices (p,) of the joints whose compliances are the parameters.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        if content is None:
            return cls([], np.empty(0))
        _require_few(content, len(Chain.from_dict(robot).axes), len(unknown))
        if not isinstance(content, list):
            return cls([_harm(content, robot, unknown, WHERE)], np.ones(1))
        places = [f"{WHERE}.{i}" for i in range(len(rows(content, MOST_TASKS, WHERE)))]
        given = zip(content, places, strict=True)
        each = [_harm(task, robot, unknown, place) for task, place in given]
        return cls(each, _shares(content, places))

    @classmethod
    def of_markers(
        cls, content: Any, chain: Chain, physics: Physics, geometry: Geometry
    ) -> "Tasks":
        """Read test poses of a study of geometry, in which the harm is that of all markers.

        The squares of a task's rows are the mean over the markers: ``|A0 d|^2 = sum_k |x_k|^2 / k``
        for displacements x_k of the k markers [m].

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        if content is None:
            return cls([], np.empty(0))
        places = [f"{WHERE}.{i}" for i in range(len(rows(content, MOST_TASKS, WHERE)))]
        _require_few(content, len(chain.axes), geometry.p, len(physics.sensors))
        each = []
        for task, place in zip(content, places, strict=True):
            task = table(task, ("q", "wrench", "weight"), place)
            q = numbers(task["q"], (chain.n,), f"{place}.q")[None]
            wrench = numbers(task["wrench"], (6,), f"{place}.wrench")[None]
            A = geometry.rows(chain, physics, q, wrench)[0]
            each.append(physics.positions(A) / np.sqrt(len(physics.sensors)))
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
    if len(tasks) * each > MOST_NUMBERS:
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


def _harm(content: Any, robot: Any, unknown: list[int], where: str) -> Array:
    """Rows (r, p) of a task with its tool: their squares are the harm.

    For a test pose alone it is the regressor A0. Over a neighbourhood it has the rows of all its
    poses, divided by the root of their number. Rotation rows count with the lever, if there is one.
    """
    optional = ("within", "lever", "weight", "weights")
    task = table(content, ("q", "tool", "wrench"), where, optional)
    chain = Chain.from_dict(robot | {"tool": task["tool"]})
    q = numbers(task["q"], (chain.n,), f"{where}.q")
    wrench = numbers(task["wrench"], (6,), f"{where}.wrench")
    within = number(task.get("within", 0.0), f"{where}.within")
    lever = number(task.get("lever", 0.0), f"{where}.lever")
    if not 0 <= within <= np.pi or not 0 <= lever <= LONGEST_LEVER:
        raise ValueError(f"{where}: expected an angle within half a turn, and a lever in metres")
    poses = neighbourhood(chain, q, within) if within else q[None]
    weights = read_weights(task.get("weights", []), len(chain.axes), f"{where}.weights")
    A = regressors(chain, unknown, poses, np.tile(wrench, (len(poses), 1)), weights)
    scale = np.array([1.0, 1.0, 1.0, lever, lever, lever])
    rows_of_all = (A * scale[:, None])[:, : 6 if lever else 3]
    return np.concatenate(rows_of_all) / np.sqrt(len(poses))
