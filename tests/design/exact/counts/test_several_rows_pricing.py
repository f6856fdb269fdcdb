"""Searches over shortlists: at their end no exchange of all candidates improves a plan."""

import numpy as np
import pytest

import criteria
import edtk
from edtk.design.exact.counts import pricing_for as module
from edtk.design.exact.counts import several_rows_pricing
from edtk.design.exact.counts.convex_loss import ConvexLoss
from edtk.design.exact.counts.counts_bound import Scatter
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.pricing_for import pricing_for
from edtk.design.exact.counts.several_rows_pricing import (
    SeveralRowsPricing,
    Shortlist,
    place_tangent,
)

RNG = np.random.default_rng(11)
N = 90
P = 5
M = 6
ROWS = RNG.normal(size=(N, 3, P)) * RNG.uniform(0.2, 2.0, size=(N, 1, 1))
TARGET = RNG.normal(size=(2, P))
NOTHING = np.zeros((P, P))
NAMES = ("A", "D", "rho0")


@pytest.fixture(autouse=True)
def every_problem_is_large(monkeypatch):
    """Small problems are searched as very large ones are, with short lists of few candidates."""
    monkeypatch.setattr(module, "MANY_PRODUCTS", 0.0)
    monkeypatch.setattr(several_rows_pricing, "LISTED", 2)
    monkeypatch.setattr(several_rows_pricing, "PART", 7)
    monkeypatch.setattr(several_rows_pricing, "KICKS", 6)


def pricing(name: str, limits: Limits) -> SeveralRowsPricing:
    """How a criterion is searched for."""
    rows = ROWS if limits.sized else np.concatenate([ROWS, np.zeros((1, 3, P))])
    flat = ROWS.reshape(-1, P)
    found = pricing_for(criteria.create(name, TARGET), Scatter(rows, limits), flat.T @ flat / N)
    assert isinstance(found, SeveralRowsPricing)
    return found


def best_of_all(own: SeveralRowsPricing, places: np.ndarray) -> float:
    """The least cost that one exchange within the limits leads to."""
    least = np.inf
    for place in range(len(places)):
        trials = np.repeat(places[None], len(own.scatter.rows), axis=0)
        trials[:, place] = np.arange(len(trials))
        costs = own.criterion.cost(own.scatter.information(trials))
        allowed = own.limits.allowed(places[None], place, own.candidates)
        least = min(least, costs.min() if allowed is None else costs[allowed[0]].min())
    return float(least)


LIMITS = {
    "free": Limits(M, NOTHING),
    "a prior": Limits(M, 3.0 * np.eye(P)),
    "each once": Limits(M, NOTHING, most=np.ones(N, dtype=int)),
    "costs": Limits(
        M, NOTHING, costs=np.linspace(1.0, 3.0, N), funds=9.0, most=np.full(N, 2), sized=False
    ),
    "few rows": Limits(2, NOTHING),
}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("kind", LIMITS)
def test_no_exchange_improves_a_plan(name, kind):
    """From any start the search ends where no exchange of all candidates is any better."""
    limits = LIMITS[kind]
    own = pricing(name, limits)
    # A place of the dearest candidates would break the funds; one candidate alone is singular.
    cheap = np.arange(limits.m) % 3 if kind == "costs" else np.arange(limits.m)
    start = np.zeros(limits.m, dtype=int) if kind in ("free", "few rows") else cheap
    for seed in range(2):
        places = own.search_from(np.random.default_rng(seed), start, 1e-6)
        cost = float(own.criterion.cost(own.scatter.information(places[None])[0]))
        assert np.isfinite(cost)
        assert best_of_all(own, places) >= cost * (1 - 1e-9)
        if limits.most is not None:
            assert (limits.counts(places[None], N)[0] <= limits.most).all()
        if limits.costs is not None:
            assert limits.spent(places[None])[0] <= limits.funds * (1 + 1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_a_tangent_bounds_every_exchange(name):
    """No candidate leads to a loss below the bound that its place's tangent proves."""
    own = pricing(name, LIMITS["a prior"])
    places = RNG.integers(0, N, size=M)
    plan = own.scatter.information(places[None])[0]
    average = (plan - own.limits.base) / M
    for place in range(M):
        level, Z, rest = place_tangent(own.loss, plan, ROWS[places[place]], average)
        joined = np.swapaxes(ROWS, 1, 2) @ ROWS
        bounds = level - np.sum(Z * joined, axis=(1, 2))
        values = np.array([own.loss.tangent(rest + one)[0] for one in joined])
        assert (values >= bounds - 1e-12 * np.abs(values)).all()
        # The tangent touches the loss at the average experiment.
        assert level - np.sum(Z * average) == pytest.approx(own.loss.tangent(rest + average)[0])


def test_most_candidates_are_left_out(monkeypatch):
    """Of a plan that no exchange improves, less than half of the candidates need a look."""
    own = pricing("D", LIMITS["free"])
    places = own.search_from(np.random.default_rng(0), np.arange(M), 1e-6)
    looked_at = []
    joined_costs = ConvexLoss.joined_costs

    def counted(self, rest, U):
        looked_at.append(len(U))
        return joined_costs(self, rest, U)

    monkeypatch.setattr(ConvexLoss, "joined_costs", counted)
    assert own._improved_once(places, NOTHING) is None
    assert 0 < sum(looked_at) < 0.5 * M * N


def test_a_shortlist_keeps_to_its_candidates():
    """A descent over some candidates is no worse, and takes none but them."""
    own = pricing("A", LIMITS["each once"])
    chosen = np.arange(0, N, 3)
    some = Shortlist.of(own.loss, ROWS, own.limits, NOTHING, chosen)
    start = np.arange(M)
    found = some.descended(start)
    assert some.value(found) < some.value(start)
    assert len(set(found.tolist())) == M
    costs = own.criterion.cost(own.scatter.information(chosen[found][None]))
    assert float(some.loss.cost(np.array([some.value(found)]))[0]) == pytest.approx(costs[0])


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_as_good_as_one_by_one(name, monkeypatch):
    """Whole searches come to plans as good as those of the prices for any criterion."""
    problem = edtk.Problem(ROWS)
    criterion = criteria.create(name, TARGET)
    quick = edtk.plan(problem, M, criterion, starts=3)
    monkeypatch.setattr(module, "MANY_PRODUCTS", np.inf)
    slow = edtk.plan(problem, M, criterion, starts=3)
    assert quick.cost <= slow.cost * (1 + 1e-9)
    assert quick.cost >= quick.lower_bound.cost * (1 - 1e-9)


def test_the_same_seed_gives_the_same_plan():
    """Two searches of one seed come to one plan, from starts and kicks at random."""
    first, second = (edtk.plan(edtk.Problem(ROWS), M, "D", seed=3, starts=1) for _ in range(2))
    np.testing.assert_array_equal(first.counts, second.counts)


def test_other_criteria_and_blocks():
    """Criteria of eigenvalues, and plans in blocks, have no such search."""
    plain = Scatter(ROWS, LIMITS["free"])
    blocked = Scatter(ROWS, Limits(M, NOTHING, blocks=(3, 3)))
    for criterion, scatter in (("E", plain), ("D", blocked)):
        found = pricing_for(criteria.create(criterion), scatter, np.eye(P))
        assert not isinstance(found, SeveralRowsPricing)
