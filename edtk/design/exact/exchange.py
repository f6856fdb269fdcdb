"""Exchange: the best m of many candidates, one place of a plan replaced after another, for many plans at once."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from criteria import Criterion
from criteria.determinant_criterion import DeterminantCriterion
from criteria.linalg.inverse import guarded_inverse
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
    start: ArrayLike,
    repeats: ArrayLike | None = None,
    dearest: Sequence[int] = (16, 64),
    thorough: bool = True,
) -> tuple[Indices, Array]:
    """Replace one place of a plan by a candidate as long as that lowers the cost (Fedorov; KL first).

    Each round judges all exchanges of a place for one of a few dearest candidates, by the criterion's gradient, and
    carries out the best. Only when none of these helps, those for more candidates are judged, and those for all if it
    is to be thorough; the plan that is returned then cannot be improved by any single exchange. The plans of a batch
    know nothing of each other and share their array operations.

    Args:
        problem: The candidates.
        criterion: What to improve; a cost that is infinite, as of a singular start, is left where possible.
        start: Candidates at the k places (..., k), the same one twice allowed.
        repeats: How often each place is measured (..., k), which is kept; once where None.
        dearest: Numbers of candidates that are judged first, then next.
        thorough: Whether to judge all others too; of a singular plan all are judged anyway.

    Returns:
        The candidates (..., k) by place, and the costs (...).
    """
    answer = np.array(start, dtype=int)
    plans = answer.reshape(-1, answer.shape[-1])  # a view
    times = np.ones(answer.shape) if repeats is None else np.asarray(repeats, dtype=float)
    times = np.broadcast_to(times, answer.shape).reshape(plans.shape)
    M = _information(problem, plans, times)
    costs, guide = np.asarray(criterion.cost(M)).reshape(-1), criterion.smoothed(30.0)

    def improved(some: Indices, size: int) -> Indices:
        """Of some plans those that an exchange for one of so many candidates has improved."""
        tried = np.broadcast_to(np.arange(problem.n), (len(some), problem.n))
        if size < problem.n:
            sensitivities = problem.sensitivities(-guide.gradient(M[some]))
            tried = np.argpartition(-sensitivities, size, axis=1)[:, :size]
        changed = _best(problem, criterion, plans[some], times[some], M[some], tried)
        new = _information(problem, changed, times[some])
        reached = criterion.cost(new)
        better = reached < costs[some] * (1 - 1e-12)
        which = some[better]
        plans[which], M[which], costs[which] = changed[better], new[better], reached[better]
        return which

    left = np.arange(len(plans))
    while len(left):
        helped = [left[:0]]
        for size in (*(size for size in dearest if size < problem.n), problem.n):
            gradual = np.isfinite(costs[left])
            some = left[gradual] if size < problem.n else left[~gradual | thorough]
            if len(some):
                helped.append(improved(some, size))
                left = np.setdiff1d(left, helped[-1])
        left = np.concatenate(helped)
    return answer, costs.reshape(answer.shape[:-1])[()]


def _information(problem: Problem, plans: Indices, times: Array) -> Array:
    """Information (b, p, p) of plans (b, k) with repetitions (b, k)."""
    return np.einsum("bk,bkij->bij", times, problem.blocks(plans))


def _best(
    problem: Problem, criterion: Criterion, plans: Indices, times: Array, M: Array, tried: Indices
) -> Indices:
    """Plans (b, k), each with the best exchange of a place for one of its candidates (b, n) carried out."""
    changed, best = plans.copy(), np.full(len(plans), np.inf)
    alike = (plans[:, :, None] == plans[:, None, :]) & (times[:, :, None] == times[:, None, :])
    of, place = np.nonzero(~np.tril(alike, -1).any(axis=2) & (times > 0))
    r = times[of, place]
    rest = M[of] - r[:, None, None] * problem.blocks(plans[of, place])
    parts = min(tried.shape[1], max(1, tried.shape[1] * len(of) // CHUNK))
    for part in np.array_split(tried, parts, axis=1):
        costs = np.full((*plans.shape, part.shape[1]), np.inf)
        costs[of, place] = _costs(
            criterion, rest, problem.blocks(part)[of], problem.factors(part)[of], r
        )
        costs = costs.reshape(len(plans), -1)
        least, (i, j) = costs.min(axis=1), np.divmod(costs.argmin(axis=1), part.shape[1])
        better = np.flatnonzero(least < best)
        changed[better] = plans[better]
        changed[better, i[better]] = part[better, j[better]]
        best[better] = least[better]
    return changed


def _costs(criterion: Criterion, rest: Array, joined: Array, U: Array, times: Array) -> Array:
    """Costs (k, n) of ``R_i + r_i U_ij' U_ij``, by one of two lemmas where the rest R_i is far from singular.

    ``det(R + r U' U) = det(R) det(I + r U R^-1 U')`` where the determinant is all that counts, else
    ``(R + r U' U)^-1 = R^-1 - R^-1 U' (I/r + U R^-1 U')^-1 U R^-1``.

    Args:
        criterion: The criterion.
        rest: What is left of a plan without a place R (k, p, p).
        joined: Information ``U' U`` (k, n, p, p) of what may take that place.
        U: Its factors (k, n, rows, p).
        times: Repetitions r (k,).
    """
    _, cov, regular = guarded_inverse(rest, ACCURATE)
    largest = times[:, None] * np.diagonal(joined, axis1=-2, axis2=-1).max(axis=1)
    regular &= (np.diagonal(rest, axis1=-2, axis2=-1) >= ACCURATE * largest).all(axis=1)
    r = times[:, None, None, None]
    trial = rest[:, None] + r * joined
    if not regular.all():
        costs = np.empty(trial.shape[:2])
        costs[~regular] = criterion.cost(trial[~regular])
        if regular.any():
            costs[regular] = _costs(
                criterion, rest[regular], joined[regular], U[regular], times[regular]
            )
        return costs
    W = U @ cov[:, None]
    S = W @ np.swapaxes(U, -1, -2)
    eye = np.eye(U.shape[-2])
    if isinstance(criterion, DeterminantCriterion):
        log_det = (
            np.linalg.slogdet(rest).logabsdet[:, None] + np.linalg.slogdet(eye + r * S).logabsdet
        )
        return criterion.cost_of_log_determinant(log_det, rest.shape[-1])
    updated = cov[:, None] - np.swapaxes(W, -1, -2) @ np.linalg.solve(eye / r + S, W)
    return criterion.cost_of_regular(trial, updated)
