"""Bounds of weights within limits against one convex program over all candidates."""

import cvxpy as cp
import numpy as np
import pytest

import criteria
from edtk.design.exact.counts.counts_bound import COUNTS_GAP, counts_bound
from edtk.design.exact.counts.limits import Limits
from edtk.design.problem import Problem

N = 10
P = 3
SIZE = 6


def least_cost(rows, name, costs, funds):
    """The least cost of weights within limits, by one program."""
    n = cp.Variable(N, nonneg=True)
    M = sum(n[i] * np.outer(rows[i], rows[i]) for i in range(N))
    limits = [n <= 1, cp.sum(n) == SIZE]
    if costs is not None:
        limits.append(costs @ n <= funds)
    objective = {
        "D": cp.Maximize(cp.log_det(M) / P),
        "A": cp.Minimize(cp.matrix_frac(np.eye(P), M)),
        "E": cp.Maximize(cp.log(cp.lambda_min(M))),
    }[name]
    value = cp.Problem(objective, limits).solve(solver="CLARABEL")
    return value if name == "A" else np.exp(-value)


@pytest.mark.parametrize("name", ["D", "A", "E"])
@pytest.mark.parametrize("priced", [False, True])
def test_the_bound_is_the_least_cost_of_weights_within_the_limits(name, priced):
    """The bound is below that of the program, and by no more than its own gap."""
    rng = np.random.default_rng(4)
    rows = rng.normal(size=(N, P))
    costs = rng.uniform(0.5, 1.5, N) if priced else None
    funds = 1.1 * np.sort(costs)[:SIZE].sum() if priced else np.inf
    limits = Limits(SIZE, np.zeros((P, P)), np.ones(N, dtype=int), costs, funds)
    start = np.zeros(N)
    start[np.argsort(costs if priced else np.zeros(N))[:SIZE]] = 1.0
    found = counts_bound(
        Problem(rows[:, None, :]),
        criteria.create(name),
        limits,
        start,
        np.eye(P)[None],
    )
    least = least_cost(rows, name, costs, funds)
    assert found.cost <= least * (1 + 1e-6)
    assert found.cost >= least * (1 - COUNTS_GAP - 1e-6)
    assert found.gap <= COUNTS_GAP
    assert found.counts.sum() == pytest.approx(SIZE)
    assert found.counts.max() <= 1 + 1e-9
