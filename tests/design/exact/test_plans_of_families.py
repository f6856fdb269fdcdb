"""Exact plans under criteria with parameters: the best of all, and never better than the bound."""

from itertools import combinations_with_replacement

import numpy as np
import pytest
from matrices import make

import criteria
import edtk

P = 3
N = 7
SIZE = 4
A = np.random.default_rng(1).normal(size=(N, 1, P))
PROBLEM = edtk.Problem(A)
PLANS = np.array(list(combinations_with_replacement(range(N), SIZE)))
INFORMATION = np.einsum("bkri,bkrj->bij", A[PLANS], A[PLANS])
NAMES = ("I", "c", "Ds", "phi 0.5", "phi 3", "prediction_G", "bayes_D", "bayes_A", "compound")


@pytest.mark.parametrize("name", [*NAMES, "minimax"])
def test_the_best_plan_of_all_is_found_and_bounded(name):
    """Of all plans of four experiments on seven candidates none is better than the one found."""
    c = make(name, P)
    best = float(c.cost(INFORMATION).min())
    found = edtk.plan(PROBLEM, SIZE, c, seed=0, starts=10)
    assert found.cost == pytest.approx(best, rel=1e-9)
    assert found.lower_bound.cost <= best * (1 + 1e-9)
    assert found.efficiency > 0.6
    assert found.criterion is c


def test_a_prior_is_shared_by_all_experiments():
    """The bound of a Bayesian criterion is that of weights whose prior is the share of each."""
    c = criteria.create("bayes_D", precision=np.diag([1.0, 4.0, 9.0]))
    found = edtk.plan(PROBLEM, 6, c, seed=0, starts=4)
    relaxed = edtk.relax(PROBLEM, c, size=6)
    assert found.lower_bound.cost == pytest.approx(relaxed.proved_bound.cost / 6, rel=1e-5)


def test_a_call_takes_a_table():
    """As a study's file has it."""
    found = edtk.plan(PROBLEM, SIZE, {"name": "phi", "q": 1}, seed=0, starts=4)
    assert found.cost == pytest.approx(edtk.plan(PROBLEM, SIZE, "A", seed=0, starts=4).cost / P)
    assert edtk.relax(PROBLEM, {"name": "phi", "q": 1}).gap < 1e-6


@pytest.mark.parametrize("x", [0.0, 0.3, -0.7])
def test_the_best_plan_may_be_singular(x):
    """A parabola is known best at a place by measuring there alone, four times."""
    grid = np.linspace(-1, 1, 21)
    rows = edtk.Problem(np.vander(grid, 3, increasing=True)[:, None, :])
    found = edtk.plan(rows, SIZE, criteria.create("c", c=[1, x, x**2]), seed=0)
    assert found.value == pytest.approx(1 / SIZE, rel=1e-9)
    assert found.counts[np.abs(grid - x).argmin()] == SIZE


@pytest.mark.parametrize("name", NAMES)
def test_exchange_under_criteria_with_parameters(name):
    """No single exchange improves the result, and its cost is that of the criterion."""
    c = make(name, P)
    starts = np.random.default_rng(2).integers(N, size=(6, SIZE))
    places, costs = edtk.exchange(PROBLEM, c, starts)
    M = np.einsum("bkri,bkrj->bij", A[places], A[places])
    np.testing.assert_allclose(costs, c.cost(M), rtol=1e-9)
    for own, cost in zip(places, costs, strict=True):
        for place in range(SIZE):
            others = np.tile(own, (N, 1))
            others[:, place] = np.arange(N)
            M = np.einsum("bkri,bkrj->bij", A[others], A[others])
            assert c.cost(M).min() >= cost * (1 - 1e-9)


def test_exchange_of_plans_that_share_a_prior():
    """Plans of several sizes would have several priors: one line says so."""
    c = criteria.create("bayes_A", precision=np.eye(P))
    with pytest.raises(edtk.UserError, match="expected plans of one size"):
        edtk.exchange(PROBLEM, c, [[0, 1], [2, 3]], repeats=[[1, 1], [2, 1]])
