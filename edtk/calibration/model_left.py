"""What errors of the model leave in tasks after a compensation, as far as a sheet tells them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from edtk.findings.fitted_data import FittedData
from edtk.fit.distributions import NormalMixture, weighted_median
from edtk.fit.measurements import Measurements
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.missing_pieces import MissingPieces, PossibleSprings
from edtk.measure.task import Task, Tasks
from edtk.system.parsing import not_negative_of, numbers_of
from edtk.system.typing import Array

LENGTHS = 3  # rows of a task that are a position, ahead of a rotation
DIGITS = 12  # of what is written, to print predictions as they are


@dataclass(frozen=True, eq=False)
class ModelLeft:
    """Springs, and what the model leaves out, that a calibration leaves possible.

    Attributes:
        joints: Indices (p,) of the identified joints, in the order of the springs.
        pieces: What may be missing.
        possible: Their sizes, and the springs.
        noise: Covariance (p, p) of the springs by the noise alone.
        beside: Covariance (p + a, p + a) of the compliances that commands take by what the sheet
            cannot tell [(rad/(N m))^2].
        constant: What is left out of a coordinate in any pose, whatever loads it [m].
        dof: Degrees of freedom of the noise; inf where it is known.
    """

    joints: tuple[int, ...]
    pieces: MissingPieces
    possible: PossibleSprings
    noise: Array
    beside: Array
    constant: float = 0.0
    dof: float = np.inf

    @classmethod
    def of(cls, fitted: FittedData, root: Array | None) -> "ModelLeft | None":
        """What a calibration leaves; None where the study says that its model is exact.

        Args:
            fitted: The measurements and their fit.
            root: Root (p + a, c) of the errors by what the sheet cannot tell.
        """
        found = fitted.model_error
        if found is None or root is None:
            return None
        dof = np.inf if fitted.fit.known else fitted.fit.covariance_dof
        joints = tuple(fitted.study.model.joints)
        known = (found.noise, root @ root.T, found.constant, dof)
        return cls(joints, found.pieces, found.possible, *known)

    def mixture(self, model: ElastostaticModel, q: Array, wrench: Array) -> NormalMixture:
        """Errors (t, rows) in poses by noise and model.

        Args:
            model: The robot with the task's tool, and the rows that count.
            q: Poses (t, n) [rad or m].
            wrench: Loads (t, 6) or (6,) [N, N m].
        """
        identified = replace(model, unknown=self.joints)
        wrench = np.broadcast_to(wrench, (len(q), np.shape(wrench)[-1]))
        A = np.concatenate(
            [self.pieces.shared(model, q, wrench), identified.regressor(q, wrench)], axis=-1
        )
        mean, V = self.possible.errors(A, self.pieces.turns(model, q, wrench))
        V[..., range(LENGTHS), range(LENGTHS)] += self.constant**2
        return NormalMixture(self.possible.weights, mean, V, self.dof)

    def of_readings(self, model: ElastostaticModel, data: Measurements, A: Array) -> NormalMixture:
        """Coordinates (m rows, 1) of readings, each by itself.

        Args:
            model: The robot with its calibration tool, and the measured rows.
            data: Poses, loads and instruments.
            A: Regressors (m, rows, p + a), those of the identified joints first.
        """
        given = (model, data.q, data.wrench, lambda frames: data.motion_of(model, frames))
        every = np.concatenate([self.pieces.shared(*given), A[..., : len(self.joints)]], axis=-1)
        rows = every.reshape(-1, 1, every.shape[-1])
        turns = self.pieces.turns(*given)
        mean, V = self.possible.errors(rows, turns.reshape(-1, 1, turns.shape[-1]))
        return NormalMixture(self.possible.weights, mean, V, self.dof)

    def in_task(self, task: Task) -> NormalMixture:
        """Errors (N, rows) in the poses of a task; rotations count with its lever."""
        q = np.atleast_2d(task.poses)
        model = replace(task.model, rows="pose") if task.lever else task.model
        found = self.mixture(model, q, task.wrench)
        if not task.lever:
            return found
        scale = np.array([1.0, 1.0, 1.0, *[task.lever] * 3])
        V = found.covariance * scale * scale[:, None]
        return replace(found, mean=found.mean * scale, covariance=V)

    def size(self, tasks: Tasks) -> float:
        """Root mean square error in tasks by noise and model [m]."""
        each = [np.square(self.in_task(task).sizes).mean(axis=1) for task in tasks]
        squares = np.einsum("t,ts->s", tasks.shares, np.array(each))
        return float(np.sqrt(weighted_median(squares, self.possible.weights)))

    def chance_beyond(self, tasks: Tasks, joints: tuple[int, ...], size: float) -> float:
        """Chance of a larger error in the test poses.

        Args:
            tasks: The test poses.
            joints: Indices (p + a,) of all joints whose compliances are taken.
            size: An error [m].
        """
        every = [self._with_others(task, joints) for task in tasks]
        chances = [float(one.beyond(np.array([size]))[0]) for one in every]
        return float(tasks.shares @ np.array(chances))

    def _with_others(self, task: Task, joints: tuple[int, ...]) -> NormalMixture:
        """Errors (1, rows) in a test pose by all that is uncertain."""
        here = replace(task, within=0.0)
        A = replace(here, unknown=joints).harm(np.atleast_2d(task.q))
        return self.in_task(here).plus(A @ self.beside @ np.swapaxes(A, -1, -2))

    def quantile(self, tasks: Tasks, joints: tuple[int, ...], level: float) -> float:
        """A quantile of the error in the worst test pose [m]; see `chance_beyond`."""
        found = [self._with_others(task, joints).quantiles([level]) for task in tasks]
        return float(np.max(found))

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers in SI units, and shares, in the order of the joints."""
        return {
            **possible_to_dict(self.pieces, self.possible),
            "noise": self.noise.tolist(),
            "constant": self.constant,
            "beside": self.beside.tolist(),
            "dof": self.dof if np.isfinite(self.dof) else None,
        }

    @classmethod
    def from_dict(cls, given: Mapping[str, Any], joints: tuple[int, ...], n: int) -> "ModelLeft":
        """What a file says, see `to_dict`.

        Args:
            given: Its table.
            joints: Indices (p,) of the joints, in the order of the springs.
            n: Number of joints of the robot.

        Raises:
            ValueError: A number is missing, or none.
        """
        pieces, possible = possible_from_dict(given, len(joints), n)
        dof = np.inf if given.get("dof") is None else float(not_negative_of(given, "dof", ()))
        order = given.get("beside")
        a = len(order) if isinstance(order, list) else 0
        beside = numbers_of(given, "beside", (a, a))
        noise = numbers_of(given, "noise", (len(joints), len(joints)))
        constant = float(not_negative_of(given, "constant", ()))
        return cls(joints, pieces, possible, noise, beside, constant, dof)


def possible_to_dict(pieces: MissingPieces, possible: PossibleSprings) -> dict[str, Any]:
    """Pieces and what is possible of them, as plain numbers in SI units, and shares."""
    lower = np.tril_indices(possible.mean.shape[1])
    return {
        "compliance": pieces.k.tolist(),
        "load": pieces.load.tolist(),
        "weights": possible.weights.tolist(),
        "turn": possible.turn.tolist(),
        "mean": [_short(row) for row in possible.mean],
        "covariance": [_short(one[lower]) for one in possible.covariance],
    }


def possible_from_dict(
    given: Mapping[str, Any], p: int, n: int
) -> tuple[MissingPieces, PossibleSprings]:
    """What a file says of p parameters and n joints, see `possible_to_dict`.

    Raises:
        ValueError: A number is missing, or none.
    """
    pieces = MissingPieces(
        not_negative_of(given, "compliance", (n,)), not_negative_of(given, "load", (n,))
    )
    rows = given.get("weights")
    s = len(rows) if isinstance(rows, list) else 0
    order = len(pieces.kinds) + p
    weights = not_negative_of(given, "weights", (s,))
    if not weights.sum() > 0:
        raise ValueError("weights: expected a number that is not zero")
    lower = np.tril_indices(order)
    covariance = np.zeros((s, order, order))
    covariance[:, lower[0], lower[1]] = numbers_of(given, "covariance", (s, len(lower[0])))
    whole = covariance + np.swapaxes(np.tril(covariance, -1), 1, 2)
    turn = not_negative_of(given, "turn", (s,))
    mean = numbers_of(given, "mean", (s, order))
    return pieces, PossibleSprings(weights / weights.sum(), turn, mean, whole)


def _short(numbers: Array) -> list[float]:
    """Numbers with so many digits as are written."""
    return [float(f"{x:.{DIGITS}g}") for x in numbers.tolist()]
