"""Convex relaxation over discretised candidates: weights instead of whole numbers of experiments."""

import warnings
from dataclasses import dataclass

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from criteria import Criterion
from edtk.design.problem import Problem

Array = NDArray[np.float64]
SOLVERS = ("CLARABEL", "SCS")


class RelaxationError(RuntimeError):
    """No solver returned a design whose certificate could be computed."""


@dataclass(frozen=True, eq=False)
class Relaxation:
    """Weights of one experiment's worth of measurements, and what they are worth.

    Attributes:
        weights: Non-negative (n,), of sum one.
        cost: The criterion's cost of these weights.
        bound: No weights over these candidates have a lower cost.
        solver: The solver that answered.
    """

    weights: Array
    cost: float
    bound: float
    solver: str

    @property
    def gap(self) -> float:
        """Relative gap ``1 - bound/cost``."""
        return 1.0 - self.bound / self.cost


def relax(problem: Problem, criterion: Criterion, prune: float = 1e-5) -> Relaxation:
    """Minimise the criterion's cost over the weights of all candidates.

    The parameters stay as they are but for one common scale, which the homogeneity of the cost undoes. With
    multiplier Z of ``M == sum w_i M_i``, every design obeys ``<Z, M> <= t = max <Z, M_i>``, so no cost is below
    ``min {cost(M): <Z, M> <= t}``: for a smooth criterion take ``Z = -gradient`` at the design found, where
    that minimum is the design itself, scaled, and ``bound = cost (<Z, M>/t)^degree``.

    Args:
        problem: The candidates.
        criterion: A convex criterion with an `expression`.
        prune: Weights below this fraction of the largest are dropped; the certificate is computed after.

    Raises:
        RelaxationError: No solver finds a design, or the candidates cannot identify all parameters.
        NotImplementedError: The criterion has no convex expression.
    """
    blocks = problem.information_blocks
    unit = np.trace(blocks.mean(axis=0)) / problem.p
    if not np.isfinite(criterion.cost(blocks.mean(axis=0))):
        raise RelaxationError("the candidates together cannot identify all parameters")
    scaled = blocks / unit
    failures = []
    for solver in SOLVERS:
        try:
            weights, Z = _solve(scaled, _normalised(criterion, scaled.mean(axis=0)), solver)
        except (cp.SolverError, ValueError, ArithmeticError) as error:
            failures.append(f"{solver}: {error}")
            continue
        weights = np.where(weights > prune * weights.max(), weights, 0.0)
        weights /= weights.sum()
        M = np.tensordot(weights, scaled, axes=1)
        bound = _bound(criterion, M, Z, scaled)
        power = unit**-criterion.degree
        return Relaxation(weights, float(criterion.cost(M)) * power, bound * power, solver)
    raise RelaxationError(f"no solver found a design for criterion {criterion.name} ({'; '.join(failures)})")


def _normalised(criterion: Criterion, M: Array) -> tuple[Criterion, float]:
    """The criterion and the cost of the mean design, to divide by."""
    return criterion, float(criterion.cost(M)) ** criterion.expression_power


def _solve(blocks: Array, scaled: tuple[Criterion, float], solver: str) -> tuple[Array, Array]:
    """Weights (n,) and the multiplier (p, p) of ``M == sum w_i M_i``."""
    criterion, unit = scaled
    n, p = blocks.shape[:2]
    w = cp.Variable(n, nonneg=True)
    M = cp.Variable((p, p), symmetric=True)
    rows, columns = np.triu_indices(p)
    balance = cp.vec(M, order="C")[rows * p + columns] == blocks[:, rows, columns].T @ w
    program = cp.Problem(cp.Minimize(criterion.expression(M) / unit), [balance, cp.sum(w) == 1])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # an inaccurate answer is judged by its certificate, not by its status
        program.solve(solver=solver)
    if w.value is None or not np.isfinite(w.value).all():
        raise ValueError(f"status {program.status}")
    weights = np.maximum(w.value, 0.0)
    Z = np.zeros((p, p))
    Z[rows, columns] = balance.dual_value * np.where(rows == columns, 1.0, 0.5)
    Z = Z + Z.T - np.diag(np.diag(Z))
    return weights / weights.sum(), Z * np.sign(np.trace(Z))


def _bound(criterion: Criterion, M: Array, Z: Array, blocks: Array) -> float:
    """Lower bound on the cost of any weights, from a multiplier."""
    if criterion.smooth:
        Z = -criterion.gradient(M)
        t = np.einsum("ij,nij->n", Z, blocks).max()
        return float(criterion.cost(M) * (np.sum(Z * M) / t) ** criterion.degree)
    values, V = np.linalg.eigh(Z)
    Z = (V * np.maximum(values, 0.0)) @ V.T  # any positive semidefinite Z is a valid multiplier
    Z /= np.einsum("ij,nij->n", Z, blocks).max()
    X = cp.Variable(Z.shape, symmetric=True)
    polar = cp.Problem(cp.Minimize(criterion.expression(X)), [cp.trace(Z @ X) <= 1])
    polar.solve(solver="CLARABEL")
    return float(polar.value ** (1.0 / criterion.expression_power))
