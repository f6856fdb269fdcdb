"""Costs after exchanges for all candidates, against those of one matrix for each of them."""

import numpy as np
import pytest

import criteria
from criteria.linalg.typing import triangle
from edtk import Problem, exchange
from edtk.design.exact.exchange_costs import (
    MOST_ENTRIES,
    CandidatePrices,
    _eliminated,
    exchange_costs,
)

QUICK = ("A", "D", "O1", "rho0")
P = 5
N = 60
PLANS = 4


def problem(rows: int, prior: bool = False) -> Problem:
    """Random candidates."""
    rng = np.random.default_rng(rows)
    return Problem(rng.normal(size=(N, rows, P)), prior=0.1 * np.eye(P) if prior else None)


def rests(smallest: float) -> np.ndarray:
    """Information of plans of which the least eigenvalue is about so much."""
    rng = np.random.default_rng(3)
    Q = np.linalg.qr(rng.normal(size=(PLANS, P, P)))[0]
    return Q * np.geomspace(1.0, smallest, P) @ np.swapaxes(Q, 1, 2)


def prices(name: str, candidates: Problem) -> tuple[criteria.Criterion, CandidatePrices]:
    """A criterion with its prices."""
    criterion = criteria.create(name, np.random.default_rng(9).normal(size=(2, P)))
    found = CandidatePrices.of(criterion, candidates)
    assert found is not None
    return criterion, found


@pytest.mark.parametrize("name", QUICK)
@pytest.mark.parametrize("rows", [1, 2, 3, 5])
def test_as_one_by_one(name, rows):
    """They are the costs of the updated matrices, whatever the rows and the repetitions."""
    candidates = problem(rows)
    criterion, quick = prices(name, candidates)
    rest = rests(0.1)
    times = np.arange(1.0, 1 + PLANS)
    sums = rest[:, None] + times[:, None, None, None] * candidates.blocks()
    np.testing.assert_allclose(quick.costs(rest, times), criterion.cost(sums), rtol=1e-12)


@pytest.mark.parametrize("size", [2, 3, 6])
def test_large_matrices_of_low_rank(size):
    """``I + r x x'`` and ``tr (I + r x x')^-1`` keep their digits where x x' is 1e8.

    Determinants that are written out would have none left.
    """
    x = np.linspace(1.0, 2.0, size)
    i, j = triangle(size)
    S = np.outer(x, x)[i, j][None, :, None] * 1e8
    E = np.eye(size)[i, j][None, :, None].copy()
    log_det, trace = _eliminated(S.copy(), E, np.full((1, 1), 2.0))
    whole = 1 + 2e8 * x @ x
    assert _eliminated(S, None, np.full((1, 1), 2.0))[0] == pytest.approx(np.log(whole), abs=1e-6)
    assert not log_det.any()
    assert trace == pytest.approx(2.0 * (size - 1 + 1 / whole), rel=1e-6)


@pytest.mark.parametrize("name", QUICK)
def test_singular_plans(name):
    """Of plans that leave directions open the sums are inverted themselves."""
    candidates = problem(3)
    criterion, quick = prices(name, candidates)
    rest = np.diag([1.0, 1.0, 1.0, 0.0, 0.0])[None]
    direct = criterion.cost(rest + candidates.blocks())
    assert quick.costs(rest, np.ones(1))[0].tolist() == direct.tolist()


@pytest.mark.parametrize("name", ["E", "G", "O2", "O4"])
def test_other_criteria_have_none(name):
    """Criteria of eigenvalues and of maxima are priced one by one."""
    assert CandidatePrices.of(criteria.create(name), problem(3)) is None


def test_many_candidates_have_none():
    """Very many candidates are not all priced in each round."""
    rows = np.ones((MOST_ENTRIES // P**2 + 1, 1, P))
    assert CandidatePrices.of(criteria.create("A"), Problem(rows)) is None


@pytest.mark.parametrize("name", QUICK)
@pytest.mark.parametrize("prior", [False, True])
def test_no_exchange_improves_the_plan(name, prior):
    """An exchange ends where no single candidate lowers the cost, told by `exchange_costs`."""
    candidates = problem(3, prior)
    criterion, _ = prices(name, candidates)
    start = np.random.default_rng(1).integers(0, N, (3, 4))
    places, costs = exchange(candidates, criterion, start, thorough=False)
    assert (costs < criterion.cost(candidates.plan_information(start, np.ones(start.shape)))).all()
    for own, cost in zip(places, costs, strict=True):
        for place in range(4):
            others = np.delete(own, place)
            rest = candidates.plan_information(others[None], np.ones((1, 3)))
            if prior:
                rest = rest + 0.1 * np.eye(P)
            after = exchange_costs(criterion, rest, candidates.factors()[None], np.ones(1))
            assert after.min() >= cost * (1 - 1e-11)
