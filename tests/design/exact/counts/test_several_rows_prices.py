"""Prices of candidates of several rows, of which a bound leaves out those that cannot be best."""

import numpy as np
import pytest

import criteria
import edtk
from edtk.design.exact.counts import pricing_for as module
from edtk.design.exact.counts import several_rows_prices
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.pricing_for import pricing_for
from edtk.design.exact.counts.scatter import Scatter
from edtk.design.exact.counts.several_rows_prices import SeveralRowsPrices, SeveralRowsPricing

RNG = np.random.default_rng(11)
N = 90
P = 5
M = 6
ROWS = RNG.normal(size=(N, 3, P)) * RNG.uniform(0.2, 2.0, size=(N, 1, 1))
TARGET = RNG.normal(size=(2, P))
PLACES = RNG.integers(0, N, size=(3, M))


@pytest.fixture(autouse=True)
def every_problem_is_large(monkeypatch):
    """Small problems are priced as very large ones are, a few candidates at a time."""
    monkeypatch.setattr(module, "MANY_PRODUCTS", 0.0)
    monkeypatch.setattr(several_rows_prices, "SHORTLIST", 8)
    monkeypatch.setattr(several_rows_prices, "PART", 7)


def pricing(name: str, limits: Limits | None = None) -> SeveralRowsPricing:
    """How a criterion is priced."""
    scatter = Scatter(ROWS, limits or Limits(M, np.zeros((P, P))))
    flat = ROWS.reshape(-1, P)
    found = pricing_for(criteria.create(name, TARGET), scatter, flat.T @ flat / N)
    assert isinstance(found, SeveralRowsPricing)
    return found


def costs_at(name: str, places: np.ndarray, place: int) -> np.ndarray:
    """Costs (b, n) with each candidate at a place."""
    trials = np.repeat(places[:, None], N, axis=1)
    trials[:, :, place] = np.arange(N)
    U = ROWS[trials].reshape(*trials.shape[:2], -1, P)
    return criteria.create(name, TARGET).cost(np.swapaxes(U, -1, -2) @ U)


@pytest.mark.parametrize("name", ["A", "D", "rho0"])
def test_the_best_of_all(name):
    """The bound leaves out no candidate that is the best for its place, from plan to plan."""
    own = pricing(name)
    places = PLACES.copy()
    prices = own.prices(places, 0.0, own.rounds[-1])
    for place in range(M):
        costs = costs_at(name, places, place)
        before = costs[np.arange(3), places[:, place]]
        new, gain = prices.best(place, None)
        least = costs.min(axis=1)
        np.testing.assert_allclose(costs[np.arange(3), new], least, rtol=1e-9)
        np.testing.assert_allclose(gain, 1 - least / before, atol=1e-9)
        prices.replace(np.arange(3), place, new)
        places[:, place] = new


def test_most_candidates_are_left_out(monkeypatch):
    """Of a plan that no exchange improves, less than half of the candidates need a look."""
    found = edtk.plan(edtk.Problem(ROWS), M, "D")
    places = np.repeat(np.arange(N), found.counts)[None]
    own = pricing("D")
    looked_at = []
    costs_of = SeveralRowsPrices._costs_of

    def counted(self, plan, cov, part):
        looked_at.append(len(part))
        return costs_of(self, plan, cov, part)

    monkeypatch.setattr(SeveralRowsPrices, "_costs_of", counted)
    prices = own.prices(places, 0.0, N)
    gains = [prices.best(place, None)[1][0] for place in range(M)]
    assert max(gains) <= 1e-9
    assert 0 < sum(looked_at) < 0.5 * M * N


def test_allowed_candidates_alone():
    """What the limits forbid is not chosen."""
    own = pricing("A")
    allowed = np.zeros((3, N), dtype=bool)
    allowed[:, ::2] = True
    new, gain = own.prices(PLACES.copy(), 0.0, N).best(0, allowed)
    costs = np.where(allowed, costs_at("A", PLACES, 0), np.inf)
    better = gain > 0
    assert better.any()
    np.testing.assert_array_equal(new[better], costs.argmin(axis=1)[better])


@pytest.mark.parametrize("name", ["A", "D", "rho0"])
def test_as_good_as_one_by_one(name, monkeypatch):
    """Whole searches come to plans as good as those of the prices for any criterion."""
    problem = edtk.Problem(ROWS)
    criterion = criteria.create(name, TARGET)
    quick = edtk.plan(problem, M, criterion, starts=8)
    monkeypatch.setattr(module, "MANY_PRODUCTS", np.inf)
    slow = edtk.plan(problem, M, criterion, starts=8)
    assert quick.cost == pytest.approx(slow.cost, rel=5e-3)
    assert quick.cost >= quick.lower_bound.cost * (1 - 1e-9)


def test_other_criteria_and_blocks():
    """Criteria of eigenvalues, and plans in blocks, have no such prices."""
    mean = np.eye(P)
    plain = Scatter(ROWS, Limits(M, np.zeros((P, P))))
    blocked = Scatter(ROWS, Limits(M, np.zeros((P, P)), blocks=(3, 3)))
    for criterion, scatter in (("E", plain), ("D", blocked)):
        found = pricing_for(criteria.create(criterion), scatter, mean)
        assert not isinstance(found, SeveralRowsPricing)
