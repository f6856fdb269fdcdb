"""Exchange on candidate sets against enumeration."""

import doctest
from importlib import import_module
from itertools import combinations_with_replacement

import numpy as np
import pytest

import criteria
from edtk.design.exact.exchange import exchange
from edtk.design.problem import Problem
from edtk.system.errors import UserError

pytestmark = pytest.mark.slow

EPS = np.finfo(float).eps
FAMILIES = {  # and the number of starts that each is given
    "volume": (("D", "O1"), 5),
    "traces": (("A", "G", "O5", "rho0"), 8),
    "least eigenvalue": (("E", "O3"), 20),
    "ratio of eigenvalues": (("O2", "O4"), 100),
}


def case(seed):
    """A small problem, the number of experiments, and a target."""
    rng = np.random.default_rng(seed)
    n = rng.integers(6, 10)
    rows = rng.integers(1, 3)
    p = rng.integers(2, 4)
    m = rng.integers(3, 6)
    return rng, Problem(rng.normal(size=(n, rows, p))), int(m), rng.normal(size=(2, p))


def slip(*matrices):
    """Relative error to which a cost is defined: 64 p eps cond, of the worst matrix."""
    return 64 * matrices[0].shape[-1] * EPS * max(np.linalg.cond(M).max() for M in matrices)


def trials(problem, plan, repeats):
    """Information (k, n, p, p) after each exchange of a place for a candidate."""
    blocks = problem.blocks()
    M = np.tensordot(repeats, blocks[plan], 1)
    return np.stack([M + r * (blocks - blocks[i]) for i, r in zip(plan, repeats, strict=True)])


def assert_no_exchange_helps(problem, criterion, plan, repeats, cost):
    """The cost is that of the plan, and no single exchange lowers it by more than 1e-12."""
    M = np.tensordot(repeats, problem.blocks(plan), 1)
    assert cost == pytest.approx(float(criterion.cost(M)), rel=1e-12)
    tried = trials(problem, plan, repeats)
    assert criterion.cost(tried).min() >= cost * (1 - 1e-12 - slip(M))


def assert_close_to_enumeration(names, starts, repeated):
    """The best of several starts is the best of all plans in 95 of 100 cases, else within 1 %."""
    off = []
    for seed in range(100):
        rng, problem, m, A0 = case(seed)
        criterion = criteria.create(names[seed % len(names)], A0)
        if repeated:
            repeats = rng.integers(1, 5, size=3).astype(float)
            plans = np.stack(np.meshgrid(*[range(problem.n)] * 3), axis=-1).reshape(-1, 3)
        else:
            repeats = np.ones(m)
            plans = np.array(list(combinations_with_replacement(range(problem.n), m)))
        best = criterion.cost(np.einsum("k,nkij->nij", repeats, problem.blocks()[plans])).min()
        found = np.inf
        for _ in range(starts):
            found = min(
                found,
                exchange(problem, criterion, rng.integers(0, problem.n, len(repeats)), repeats)[1],
            )
            if found <= best * (1 + 1e-9):
                break
        off.append(found / best - 1)
    assert min(off) >= -1e-9
    assert sum(x <= 1e-9 for x in off) >= 95
    assert max(off) <= 0.01


@pytest.mark.parametrize("family", FAMILIES)
def test_against_enumeration(family):
    """From random starts the best of all plans is found in 95 of 100 cases, else within 1 %."""
    assert_close_to_enumeration(*FAMILIES[family], repeated=False)


def test_repetitions_against_enumeration():
    """The same holds for places that are measured one to four times each, over all criteria."""
    assert_close_to_enumeration(criteria.available(), 40, repeated=True)


@pytest.mark.parametrize("name", criteria.available())
def test_no_single_exchange_helps(name):
    """The result is no worse than its start, and no single exchange improves it."""
    for seed in range(100, 110):
        rng, problem, m, A0 = case(seed)
        criterion = criteria.create(name, A0)
        start = rng.integers(0, problem.n, m)
        for repeats in (np.ones(m), rng.integers(1, 6, size=m).astype(float)):
            plan, cost = exchange(problem, criterion, start, repeats)
            assert cost <= criterion.cost(np.tensordot(repeats, problem.blocks(start), 1))
            assert_no_exchange_helps(problem, criterion, plan, repeats, cost)


def test_without_repetitions_each_place_counts_once():
    """Leaving the repetitions out means one each."""
    rng, problem, m, _ = case(0)
    start = rng.integers(0, problem.n, m)
    criterion = criteria.create("D")
    plan, cost = exchange(problem, criterion, start)
    again, same = exchange(problem, criterion, start, np.ones(m))
    assert (plan.tolist(), cost) == (again.tolist(), same)
    assert cost == pytest.approx(float(criterion.cost(problem.blocks(plan).sum(axis=0))), rel=1e-12)


def test_places_keep_their_order():
    """A plan that is best already comes back place by place, in the order in which it was given."""
    e = np.eye(3)[:, None]
    problem = Problem(np.concatenate([e, 0.1 * e]))
    criterion = criteria.create("D")
    for start in ([2, 0, 1], [1, 2, 0]):
        plan, _ = exchange(problem, criterion, np.array(start), np.array([3.0, 1.0, 2.0]))
        assert plan.tolist() == start


@pytest.mark.parametrize("start", [[0, 0], [1, 1]])
def test_repetitions_stay_with_their_place(start):
    """The place of three measurements ends up in the direction that counts most.

    With information 1 in the first direction and 3 in the second ``9 k_1 + k_2`` has variance 9 +
    1/3; the other way round 9/3 + 1 = 4.
    """
    problem = Problem(np.eye(2)[:, None])
    criterion = criteria.create("rho0", np.diag([3.0, 1.0]))
    plan, cost = exchange(problem, criterion, np.array(start), np.array([1.0, 3.0]))
    assert plan.tolist() == [1, 0]
    assert cost == pytest.approx(2.0, rel=slip(np.diag([3.0, 1.0])))


def test_a_place_of_no_measurement_stays():
    """A place that is measured zero times is never exchanged, and plays no part."""
    rng, problem, _, _ = case(5)
    criterion = criteria.create("A")
    start = rng.integers(0, problem.n, 5)
    plan, cost = exchange(problem, criterion, start, np.array([0.0, 1.0, 2.0, 0.0, 1.0]))
    some = [1, 2, 4]
    fewer, same = exchange(problem, criterion, start[some], np.array([1.0, 2.0, 1.0]))
    assert plan[[0, 3]].tolist() == start[[0, 3]].tolist()
    assert (plan[some].tolist(), cost) == (fewer.tolist(), same)


@pytest.mark.parametrize("name", criteria.available())
def test_what_is_there_already_counts(name):
    """Beside prior information of full rank, one more experiment is the best of all."""
    rng, problem, _, A0 = case(3)
    criterion = criteria.create(name, A0)
    A = rng.normal(size=(4, problem.p))
    beside = Problem.of_information(problem.packed, prior=A.T @ A)
    plan, cost = exchange(beside, criterion, np.array([0]))
    costs = criterion.cost(A.T @ A + problem.blocks())
    assert plan == costs.argmin()
    assert cost == pytest.approx(costs.min(), rel=slip(A.T @ A))


def test_a_singular_start_is_left():
    """A singular start that measures one candidate only ends in a regular plan of the best cost."""
    rng = np.random.default_rng(1)
    problem = Problem(rng.normal(size=(12, 2, 3)))
    criterion = criteria.create("D")
    for repeats in (np.ones(3), np.array([2.0, 1.0, 4.0])):
        plan, cost = exchange(problem, criterion, np.zeros(3, dtype=int), repeats)
        assert np.isinf(criterion.cost(repeats.sum() * problem.blocks([0])[0]))
        assert_no_exchange_helps(problem, criterion, plan, repeats, cost)
        assert np.isfinite(cost)


@pytest.mark.parametrize("name", ["D", "A", "E"])
def test_a_start_is_left_that_no_single_exchange_makes_regular(name):
    """As many places as parameters, all at one candidate, end in a regular plan all the same."""
    problem = Problem(np.random.default_rng(1).normal(size=(12, 1, 4)))
    criterion = criteria.create(name)
    plan, cost = exchange(problem, criterion, np.zeros(4, dtype=int))
    assert np.isfinite(cost)
    assert_no_exchange_helps(problem, criterion, plan, np.ones(4), cost)


def test_too_few_places_are_no_plan():
    """A single plan of fewer places than parameters is refused; of several, its cost is inf."""
    problem = Problem(np.random.default_rng(1).normal(size=(12, 1, 4)))
    criterion = criteria.create("D")
    with pytest.raises(UserError, match="no plan of 3 places was found"):
        exchange(problem, criterion, np.zeros(3, dtype=int))
    assert np.isinf(exchange(problem, criterion, np.zeros((2, 3), dtype=int))[1]).all()


@pytest.mark.parametrize("repeats", [np.ones(6), np.array([1.0, 5, 2, 1, 1, 3])])
@pytest.mark.parametrize("shortlists", [(1,), (20,), (2, 30)])
def test_many_candidates(repeats, shortlists):
    """Short lists, even of one candidate, end in a plan that none of 3000 candidates improves."""
    rng = np.random.default_rng(0)
    problem = Problem(rng.normal(size=(3000, 2, 4)))
    criterion = criteria.create("D")
    plan, cost = exchange(problem, criterion, rng.integers(0, 3000, 6), repeats, shortlists)
    assert_no_exchange_helps(problem, criterion, plan, repeats, cost)


def test_chunks(monkeypatch):
    """Candidates in chunks changes nothing."""
    rng, problem, m, _ = case(9)
    start = rng.integers(0, problem.n, m)
    criterion = criteria.create("A")
    whole = exchange(problem, criterion, start)
    monkeypatch.setattr(import_module("edtk.design.exact.exchange"), "EXCHANGES_AT_ONCE", 2)
    parts = exchange(problem, criterion, start)
    assert (parts[0].tolist(), parts[1]) == (whole[0].tolist(), whole[1])


def test_costs_of_many_parameters_come_in_parts(monkeypatch):
    """No call for costs holds more than some megabytes, so that Ctrl-C waits for none for long."""
    module = import_module("edtk.design.exact.exchange")
    sizes = []
    own = module.exchange_costs

    def costs(criterion, rest, factors, times):
        k, n, _, p = factors.shape
        sizes.append(k * n * p * p)
        return own(criterion, rest, factors, times)

    monkeypatch.setattr(module, "exchange_costs", costs)
    rng = np.random.default_rng(0)
    problem = Problem(rng.normal(size=(600, 2, 40)))
    exchange(problem, criteria.create("A"), rng.integers(0, 600, 22), [2] * 22, (16,))
    assert len(sizes) > 10
    assert max(sizes) <= 2 * module.DOUBLES_AT_ONCE


def test_where_candidates_are_fewer_than_a_list_all_are_tried():
    """Though nobody asks for it: a search that looked at none of them ended where it began."""
    problem = Problem(np.random.default_rng(2).normal(size=(6, 2, 3)))
    criterion = criteria.create("G")
    start = np.array([[0, 1, 2]])
    _, few = exchange(problem, criterion, start, thorough=False)
    _, every = exchange(problem, criterion, start)
    assert few == pytest.approx(every, rel=1e-12)
    assert few < criterion.cost(problem.plan_information(start, np.ones_like(start)))


@pytest.mark.parametrize("name", ["rho0", "D", "O2"])
@pytest.mark.parametrize("thorough", [False, True])
def test_plans_of_a_batch_do_not_see_each_other(name, thorough):
    """Plans that are exchanged together end as each does alone, singular ones included."""
    rng = np.random.default_rng(2)
    problem = Problem(rng.normal(size=(300, 2, 3)))
    criterion = criteria.create(name, rng.normal(size=(2, 3)))
    start = rng.integers(0, 300, (2, 3, 4))
    repeats = rng.integers(0, 4, (2, 3, 4)).astype(float)
    start[0, 1] = 7
    repeats[..., 0] = 1.0
    together, costs = exchange(problem, criterion, start, repeats, thorough=thorough)
    assert together.shape == start.shape
    assert costs.shape == (2, 3)
    for i in np.ndindex(2, 3):
        alone, cost = exchange(problem, criterion, start[i], repeats[i], thorough=thorough)
        assert (together[i].tolist(), costs[i]) == (alone.tolist(), cost)


def test_example():
    """The example in the docstring runs and prints what it says."""
    result = doctest.testmod(import_module("edtk.design.exact.exchange"))
    assert result.attempted > 0
    assert result.failed == 0
