"""Exchange: the best m of many candidates, one place of the plan replaced after another."""

import numpy as np
from numpy.typing import NDArray

from criteria import Criterion
from criteria.inverse import guarded_inverse
from edtk.design.problem import Problem

Array = NDArray[np.float64]
Indices = NDArray[np.int_]
CHUNK = 20_000  # exchanges that are judged at once
# Least eigenvalue, at unit diagonal, of what is left of a plan for its inverse to be updated; and least share of each
# diagonal entry, as less may be what rounding has left of nothing.
ACCURATE = 1e-6


def exchange(
    problem: Problem,
    criterion: Criterion,
    start: Indices,
    repeats: Array | None = None,
    dearest: int = 50,
    thorough: bool = True,
) -> tuple[Indices, float]:
    """Replace one place of a plan by a candidate as long as that lowers the cost (Fedorov; KL first).

    Each round judges all exchanges of a place for one of the dearest candidates, by the criterion's gradient, and
    carries out the best. Only when none of these helps, the exchanges for every candidate are judged, if it is to be
    thorough; the plan that is returned then cannot be improved by any single exchange.

    Args:
        problem: The candidates.
        criterion: What to improve; a cost that is infinite, as of a singular start, is left where possible.
        start: Candidates at the k places (k,), the same one twice allowed.
        repeats: How often each place is measured (k,), which is kept; once where None.
        dearest: Number of candidates that are judged first.
        thorough: Whether to judge all others too; of a singular plan they are judged anyway.

    Returns:
        The candidates (k,) by place, and the cost.
    """
    plan = np.array(start, dtype=int)
    times = np.ones(len(plan)) if repeats is None else np.asarray(repeats, dtype=float)
    guide, every = criterion.smoothed(30.0), np.arange(problem.n)
    M = np.tensordot(times, problem.blocks(plan), 1)
    cost = float(criterion.cost(M))
    while True:
        some = every
        if np.isfinite(cost) and dearest < problem.n:
            some = np.argpartition(-problem.prices(-guide.gradient(M)), dearest)[:dearest]
        found = _best(problem, criterion, plan, times, M, some)
        if thorough and not found[0] < cost * (1 - 1e-12) and len(some) < problem.n:
            found = _best(problem, criterion, plan, times, M, every)
        if not found[0] < cost * (1 - 1e-12):
            return plan, cost
        cost, out, into = found
        plan[out] = into
        M = np.tensordot(times, problem.blocks(plan), 1)


def _best(
    problem: Problem, criterion: Criterion, plan: Indices, times: Array, M: Array, some: Indices
) -> tuple[float, int, int]:
    """The least cost over exchanges of a place for some candidates, that place, and that candidate."""
    best = (np.inf, 0, 0)
    outs = np.unique(np.stack([plan, times], axis=1), axis=0, return_index=True)[1]
    outs = outs[times[outs] > 0]
    rest = M - times[outs, None, None] * problem.blocks(plan[outs])
    parts = min(len(some), max(1, len(some) * len(outs) // CHUNK))
    for part in np.array_split(some, parts):
        joined, U = problem.blocks(part), problem.factors(part)
        costs = _costs(criterion, rest, joined, U, times[outs])
        i, j = np.unravel_index(int(costs.argmin()), costs.shape)
        if costs[i, j] < best[0]:
            trial = float(criterion.cost(rest[i] + times[outs[i]] * joined[j]))  # free of what an update may lose
            best = min(best, (trial, int(outs[i]), int(part[j])))
    return best


def _costs(criterion: Criterion, rest: Array, joined: Array, U: Array, times: Array) -> Array:
    """Costs (k, n) of ``R_i + r_i U_j' U_j``, by one of two lemmas where the rest R_i is far from singular.

    ``det(R + r U' U) = det(R) det(I + r U R^-1 U')`` where the determinant is all that counts, else
    ``(R + r U' U)^-1 = R^-1 - R^-1 U' (I/r + U R^-1 U')^-1 U R^-1``.
    """
    _, cov, regular = guarded_inverse(rest, ACCURATE)
    largest = times[:, None] * np.diagonal(joined, axis1=-2, axis2=-1).max(axis=0)
    regular &= (np.diagonal(rest, axis1=-2, axis2=-1) >= ACCURATE * largest).all(axis=1)
    trial = rest[:, None] + times[:, None, None, None] * joined
    if not regular.all():
        costs = np.empty(trial.shape[:2])
        costs[~regular] = criterion.cost(trial[~regular])
        if regular.any():
            costs[regular] = _costs(criterion, rest[regular], joined, U, times[regular])
        return costs
    W = U @ cov[:, None]
    S = W @ np.swapaxes(U, -1, -2)
    eye, r = np.eye(U.shape[1]), times[:, None, None, None]
    if criterion.determinant_only:
        log_det = np.linalg.slogdet(rest).logabsdet[:, None] + np.linalg.slogdet(eye + r * S).logabsdet
        return criterion.cost_of_log_determinant(log_det, rest.shape[-1])
    updated = cov[:, None] - np.swapaxes(W, -1, -2) @ np.linalg.solve(eye / r + S, W)
    return criterion.cost_of_regular(trial, updated)
