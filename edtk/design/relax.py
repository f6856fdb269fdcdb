"""Convex relaxation over discretised candidates: weights instead of whole numbers of experiments."""

import warnings
from dataclasses import dataclass

import cvxpy as cp
import numpy as np
from numpy.typing import NDArray

from criteria import Criterion
from edtk.design.problem import Problem

Array = NDArray[np.float64]
SOLVERS = {
    "CLARABEL": {"tol_gap_rel": 1e-11, "tol_gap_abs": 1e-11, "tol_feas": 1e-10, "reduced_tol_gap_rel": 1e-7},
    "SCS": {"eps_rel": 1e-9, "eps_abs": 1e-9, "max_iters": 20_000},
}


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


def relax(problem: Problem, criterion: Criterion, gap: float = 1e-6, rounds: int = 60, batch: int = 40) -> Relaxation:
    """Minimise the criterion's cost over the weights of all candidates, by restricted masters and pricing.

    cvxpy solves a small master over the active candidates; the multiplier Z of ``M == sum w_i M_i`` prices all
    of them by ``<Z, M_i>``, the dearest join, those without weight leave. Parameters are whitened by the master's
    own design: with k = T k' the information becomes the identity. Whatever a solver says of its answer, cost
    and bound are computed anew from weights and multiplier, see `_bound`, and the best of each is returned.

    Args:
        problem: The candidates.
        criterion: A convex criterion with an `expression`.
        gap: Relative gap to stop at.
        rounds: Limit on the number of masters.
        batch: Candidates that join per round.

    Raises:
        RelaxationError: No solver finds a design, or the candidates cannot identify all parameters.
        NotImplementedError: The criterion has no convex expression.
    """
    if not criterion.has_expression():
        raise NotImplementedError(f"criterion {criterion.name} has no convex expression")
    blocks = problem.information_blocks
    weights = np.full(len(blocks), 1.0 / len(blocks))
    if not np.isfinite(best := float(criterion.cost(problem.information(weights)))):
        raise RelaxationError("the candidates together cannot identify all parameters")
    active = _spread(blocks, problem.information(weights), batch)
    bound, solver, answer = 0.0, "", weights
    for _ in range(rounds):
        trial, Z, solver = _master(blocks[active], criterion, problem.information(weights))
        weights = np.zeros(len(blocks))
        weights[active] = trial
        M = problem.information(weights)
        if (cost := float(criterion.cost(M))) < best:
            best, answer = cost, weights
        lower, prices = _bound(blocks, criterion, M, Z)
        bound = max(bound, lower)
        newcomers = np.setdiff1d(np.argsort(-prices, kind="stable")[:batch], active)
        if 1.0 - bound / best <= gap or not len(newcomers):
            break
        active = np.concatenate([np.flatnonzero(weights > 0), newcomers])
    return Relaxation(answer, best, bound, solver)


def _spread(blocks: Array, mean: Array, batch: int) -> NDArray[np.int_]:
    """A first active set that identifies every parameter: greedily, the block of the largest gain in det."""
    active: list[int] = []
    M = 1e-6 * mean
    for _ in range(min(batch, len(blocks))):
        gain = np.einsum("ij,nij->n", np.linalg.inv(M), blocks)
        gain[active] = -np.inf
        active.append(int(gain.argmax()))
        M = M + blocks[active[-1]]
    return np.array(active)


def _whitener(M: Array) -> Array:
    """T (p, p) with ``T' M T = I``, by a Cholesky factor of M scaled to a unit diagonal."""
    d = np.sqrt(np.diag(M))
    return np.asarray(np.linalg.inv(np.linalg.cholesky(M / np.outer(d, d)).T) / d[:, None])


def _master(blocks: Array, criterion: Criterion, around: Array, prune: float = 1e-7) -> tuple[Array, Array, str]:
    """Weights (n,), multiplier (p, p) and solver of the relaxation over a few candidates."""
    T = _whitener(around)
    failures = []
    for solver in SOLVERS:
        try:
            weights, Z = _solve(T.T @ blocks @ T, criterion, T, float(criterion.cost(around)), solver)
        except (cp.SolverError, ValueError, ArithmeticError) as error:
            failures.append(f"{solver}: {error}")
            continue
        weights = np.where(weights > prune * weights.max(), weights, 0.0)
        return weights / weights.sum(), T @ Z @ T.T, solver
    raise RelaxationError(f"no solver found a design for criterion {criterion.name} ({'; '.join(failures)})")


def _solve(blocks: Array, criterion: Criterion, T: Array, unit: float, solver: str) -> tuple[Array, Array]:
    """Weights (n,) and the multiplier Z (p, p) of ``M == sum w_i M_i`` in whitened parameters."""
    n, p = blocks.shape[:2]
    w = cp.Variable(n, nonneg=True)
    M = cp.Variable((p, p), symmetric=True)
    rows, columns = np.triu_indices(p)
    balance = cp.vec(M, order="C")[rows * p + columns] == blocks[:, rows, columns].T @ w
    _run(
        program := cp.Problem(cp.Minimize(_unit_cost(criterion, M, T, unit)), [balance, cp.sum(w) == 1]),
        solver,
    )
    if w.value is None or not np.isfinite(w.value).all():
        raise ValueError(f"status {program.status}")
    weights = np.maximum(w.value, 0.0)
    Z = np.zeros((p, p))
    Z[rows, columns] = balance.dual_value / np.where(rows == columns, 1.0, 2.0)
    Z = Z + np.triu(Z, 1).T
    return weights / weights.sum(), Z * np.sign(np.trace(Z))


def _unit_cost(criterion: Criterion, M: cp.Expression, T: Array, unit: float) -> cp.Expression:
    """The cost's expression in whitened parameters and divided by `unit`.

    A factor c on T multiplies the cost by ``c^(2 degree)``, so the division goes into T and every constant
    inside the expression is of order one.
    """
    return criterion.expression(M, T * unit ** (-0.5 / criterion.degree))


def _bound(blocks: Array, criterion: Criterion, M: Array, Z: Array) -> tuple[float, Array]:
    """Lower bound on the cost of any weights over the candidates, and the prices (n,) behind it.

    For positive semidefinite Z every design obeys ``<Z, M> <= t = max <Z, M_i>``, so by homogeneity no cost is
    below ``t^-degree min {cost(M): <Z, M> <= 1}``. Two Z are tried, and the better bound is returned: the solver's
    multiplier, which serves at kinks too, and, where the criterion is smooth, minus the gradient at M.
    """
    T = _whitener(M)
    S = np.linalg.inv(T)
    values, V = np.linalg.eigh(S @ Z @ S.T)
    Z = T @ (V * np.maximum(values, 0.0)) @ V.T @ T.T
    prices = np.einsum("ij,nij->n", Z, blocks)
    bound = _polar(criterion, Z, M, T) * prices.max() ** -criterion.degree
    if criterion.smooth:
        Z = -criterion.gradient(M)
        slopes = np.einsum("ij,nij->n", Z, blocks)
        slope = float(criterion.cost(M) * (np.sum(Z * M) / slopes.max()) ** criterion.degree)
        if slope > bound:
            return slope, slopes
    return bound, prices


def _polar(criterion: Criterion, Z: Array, M: Array, T: Array) -> float:
    """``min {cost(X): <Z, X> <= 1}``: in closed form, or, for a criterion without one, as a problem of size p.

    The latter is a solver's word: it is lowered by its tolerance, and 0, a bound that says nothing, where the
    solver gives none.
    """
    try:
        return criterion.polar(Z, M)
    except NotImplementedError:
        pass
    if criterion.smooth:
        return 0.0
    X = cp.Variable(Z.shape, symmetric=True)
    S = np.linalg.inv(T)
    Y = S @ Z @ S.T
    unit, size = float(criterion.cost(M)), float(np.trace(Y))
    program = cp.Problem(cp.Minimize(_unit_cost(criterion, X, T, unit)), [cp.trace(Y / size @ X) <= 1])
    try:
        _run(program, next(iter(SOLVERS)))
    except cp.SolverError:
        return 0.0
    if program.status != cp.OPTIMAL:
        return 0.0
    lowered = (1 - 1e-6) * float(program.value)
    return unit * lowered ** (1.0 / criterion.expression_power) * size**criterion.degree


def _run(program: cp.Problem, solver: str) -> None:
    """Solve quietly: an inaccurate answer is judged by its certificate, not by its status."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        program.solve(solver=solver, **SOLVERS[solver])
