"""Exchange: the best m of many candidates, one experiment replaced after another."""

import numpy as np
from numpy.typing import NDArray

from criteria import Criterion
from edtk.design.packed import unpack
from edtk.design.problem import Problem

Array = NDArray[np.float64]
Indices = NDArray[np.int_]
CHUNK = 20_000  # exchanges that are judged at once


def exchange(
    problem: Problem, criterion: Criterion, start: Indices, kept: Array | None = None, dearest: int = 50
) -> tuple[Indices, float]:
    """Replace one experiment by a candidate as long as that lowers the cost (Fedorov; KL first).

    Each round judges all exchanges of an experiment of the plan for one of the dearest candidates, by the criterion's
    gradient, and carries out the best. Only when none of these helps, the exchanges for every candidate are judged;
    the plan that is returned cannot be improved by any single exchange.

    Args:
        problem: The candidates.
        criterion: What to improve; a cost that is infinite, as of a singular start, is left where possible.
        start: Candidates of the m experiments (m,), repetitions allowed.
        kept: Information (p, p) of experiments that are there already; None for none.
        dearest: Number of candidates that are judged first.

    Returns:
        The candidates (m,) in ascending order, and the cost.
    """
    plan = np.array(start, dtype=int)
    base = np.zeros((problem.p, problem.p)) if kept is None else kept
    guide = criterion.smoothed(30.0)
    M = base + problem.blocks(plan).sum(axis=0)
    cost = float(criterion.cost(M))
    while True:
        some = np.arange(problem.n)
        if np.isfinite(cost) and dearest < problem.n:
            some = np.argpartition(-problem.prices(-guide.gradient(M)), dearest)[:dearest]
        found = _best(problem, criterion, plan, M, some)
        if found[0] >= cost * (1 - 1e-12) and len(some) < problem.n:
            found = _best(problem, criterion, plan, M, np.arange(problem.n))
        if not found[0] < cost * (1 - 1e-12):
            return np.sort(plan), cost
        cost, out, into = found
        plan[out] = into
        M = base + problem.blocks(plan).sum(axis=0)


def _best(problem: Problem, criterion: Criterion, plan: Indices, M: Array, some: Indices) -> tuple[float, int, int]:
    """The least cost over exchanges of a plan's experiment for some candidates, the experiment and the candidate."""
    best = (np.inf, 0, 0)
    outs = np.unique(plan, return_index=True)[1]
    for part in np.array_split(some, max(1, len(some) * len(outs) // CHUNK)):
        joined = unpack(problem.packed[:, part])
        trial = (M - problem.blocks(plan[outs]))[:, None] + joined
        costs = criterion.cost(trial)
        i, j = np.unravel_index(int(np.argmin(costs)), costs.shape)
        if costs[i, j] < best[0]:
            best = (float(costs[i, j]), int(outs[i]), int(part[j]))
    return best
