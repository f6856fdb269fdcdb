"""Exchange on candidate sets against enumeration."""

from itertools import combinations_with_replacement

import numpy as np
import pytest

import criteria
from edtk.design import Problem, exchange

CASES = 10


def case(seed):
    """A small problem, the number of experiments, and a target."""
    rng = np.random.default_rng(seed)
    n, rows, p, m = rng.integers(6, 10), rng.integers(1, 3), rng.integers(2, 4), rng.integers(3, 6)
    return rng, Problem(rng.normal(size=(n, rows, p))), int(m), rng.normal(size=(2, p))


@pytest.mark.parametrize("name", criteria.available())
def test_against_enumeration(name):
    """The best of twenty starts is the best of all designs in at least nine of ten cases, and where the criterion is
    monotone never more than 1 % off.
    """
    equal = 0
    for seed in range(CASES):
        rng, problem, m, A0 = case(seed)
        criterion = criteria.create(name, A0)
        designs = np.array(list(combinations_with_replacement(range(problem.n), m)))
        best = criterion.cost(problem.blocks()[designs].sum(axis=1)).min()
        found = min(exchange(problem, criterion, rng.integers(0, problem.n, m))[1] for _ in range(20))
        assert found >= best * (1 - 1e-9)
        equal += found <= best * (1 + 1e-9)
        if criterion.monotone:
            assert found <= 1.01 * best
    assert equal >= CASES - 1


@pytest.mark.parametrize("name", criteria.available())
def test_no_single_exchange_helps(name):
    """What is returned is no worse than its start, and cannot be improved by replacing one experiment."""
    rng, problem, m, A0 = case(100)
    criterion = criteria.create(name, A0)
    start = rng.integers(0, problem.n, m)
    plan, cost = exchange(problem, criterion, start)
    blocks = problem.blocks()
    assert cost <= criterion.cost(blocks[start].sum(axis=0))
    assert cost == pytest.approx(float(criterion.cost(blocks[plan].sum(axis=0))), rel=1e-12)
    M = blocks[plan].sum(axis=0)
    for i in plan:
        assert (criterion.cost(M - blocks[i] + blocks) >= cost * (1 - 1e-9)).all()


def test_what_is_there_already_counts():
    """With the information of earlier experiments kept, one further experiment suffices, and it is the best one."""
    _, problem, _, _ = case(3)
    criterion = criteria.create("A")
    kept = problem.blocks([0, 1, 2]).sum(axis=0)
    plan, cost = exchange(problem, criterion, np.array([0]), kept)
    costs = criterion.cost(kept + problem.blocks())
    assert plan == costs.argmin()
    assert cost == pytest.approx(costs.min(), rel=1e-12)


def test_many_candidates():
    """Judging the dearest candidates first ends in a plan that no exchange for any of 3000 candidates improves."""
    rng = np.random.default_rng(0)
    problem, criterion = Problem(rng.normal(size=(3000, 2, 4))), criteria.create("D")
    plan, cost = exchange(problem, criterion, rng.integers(0, 3000, 6), dearest=20)
    M = problem.blocks(plan).sum(axis=0)
    for i in plan:
        assert (criterion.cost(M - problem.blocks(i) + problem.blocks()) >= cost * (1 - 1e-9)).all()
