"""Prices kept by low-rank updates against determinants and traces computed anew."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import criteria
from edtk.design.exact.counts.any_prices import AnyPricing
from edtk.design.exact.counts.counts_bound import Scatter
from edtk.design.exact.counts.determinant_prices import DeterminantPricing
from edtk.design.exact.counts.largest_variance_prices import LargestVariancePricing
from edtk.design.exact.counts.least_eigenvalue_prices import LeastEigenvaluePricing
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.linear_prices import LinearPricing
from edtk.design.exact.counts.pricing_for import pricing_for
from edtk.design.exact.counts.two_level_prices import TwoLevelPricing, two_levels
from edtk.design.exact.exchange_costs import constant_slope

RNG = np.random.default_rng(3)
P = 4
M = 7
ROWS = RNG.normal(size=(12, P))
BASE = np.cov(RNG.normal(size=(P, 9)))
SLOPE = BASE + np.eye(P)
TARGETS = RNG.normal(size=(5, 2, P))
LIMITS = Limits(M, BASE)
PLACES = RNG.integers(0, 12, size=(3, M))


def informations(places: np.ndarray, place: int, limits: Limits = LIMITS) -> np.ndarray:
    """Information (b, n, p, p) with each candidate at a place."""
    trials = np.repeat(places[:, None], len(ROWS), axis=1)
    trials[:, :, place] = np.arange(len(ROWS))
    X = ROWS[trials]
    M = np.swapaxes(X, -1, -2) @ X + BASE
    for block, share in enumerate(limits.shares):
        whole = X[:, :, limits.block_of == block].sum(axis=2)
        M = M - share * whole[..., :, None] * whole[..., None, :]
    return M


def costs_of(pricing, M):
    """The number that a pricing minimises, computed anew."""
    if isinstance(pricing, LargestVariancePricing):
        told = np.einsum("jra,...ab,jrb->...j", TARGETS, np.linalg.inv(M), TARGETS)
        return told.max(axis=-1)
    if isinstance(pricing, LinearPricing):
        return np.trace(SLOPE @ np.linalg.inv(M), axis1=-2, axis2=-1)
    if isinstance(pricing, DeterminantPricing):
        return 1.0 / np.linalg.det(M)
    return pricing.criterion.cost(M)


FREE = {"": LIMITS}
FIXED = Limits(M, BASE, blocks=(1, 4, 2))
BLOCKS = {" in blocks": FIXED, " in random blocks": replace(FIXED, block_variance=0.7)}
PRICED = [
    *product(["determinant", "linear", "variance", "any"], FREE.items()),
    *product(["determinant", "linear", "any"], BLOCKS.items()),
]


@pytest.mark.parametrize(
    ("kind", "limits"), [(a, b[1]) for a, b in PRICED], ids=[a + b[0] for a, b in PRICED]
)
def test_prices_stay_right_over_many_exchanges(kind, limits):
    """After each of a sweep's exchanges the best candidate and its gain are those of a new look."""
    scatter = Scatter(ROWS[:, None], limits)
    pricing = {
        "determinant": DeterminantPricing(ROWS, limits),
        "linear": LinearPricing(ROWS, limits, SLOPE),
        "variance": LargestVariancePricing(ROWS, LIMITS, TARGETS),
        "any": AnyPricing(criteria.create("E"), scatter, BASE),
    }[kind]
    places = PLACES.copy()
    prices = pricing.prices(places, 0.0, pricing.rounds[-1])
    exchanged = 0
    for place in [*range(M), *range(M)]:
        allowed = RNG.random((3, 12)) < 0.8
        new, gain = prices.best(place, allowed)
        tried = costs_of(pricing, informations(places, place, limits))
        present = tried[np.arange(3), places[:, place]]
        tried = np.where(allowed, tried, np.inf)
        assert tried[np.arange(3), new] == pytest.approx(tried.min(axis=1), rel=1e-9)
        ratio = tried.min(axis=1) / present
        expected = 1 / ratio - 1 if kind == "determinant" else 1 - ratio
        assert gain == pytest.approx(expected, abs=1e-9)
        better = np.flatnonzero(gain > 1e-10)
        exchanged += len(better)
        if len(better):
            prices.replace(better, place, new[better])
            places[better, place] = new[better]
    assert exchanged > 5


def test_the_largest_least_eigenvalue_is_found_without_a_look_at_all():
    """Whatever exchange improves the least eigenvalue, the best one is found; else none is."""
    scatter = Scatter(ROWS[:, None], LIMITS)
    T = np.linalg.inv(np.linalg.cholesky(BASE))
    criterion = criteria.create("E").transformed(T)
    pricing = pricing_for(criterion, scatter, BASE)
    places = PLACES.copy()
    prices = pricing.prices(places, 0.0, 0)
    exchanged = 0
    for place in [*range(M), *range(M)]:
        allowed = RNG.random((3, 12)) < 0.8
        new, gain = prices.best(place, allowed)
        tried = criterion.cost(informations(places, place))
        present = tried[np.arange(3), places[:, place]]
        tried = np.where(allowed, tried, np.inf)
        expected = np.maximum(1 - tried.min(axis=1) / present, 0.0)
        assert gain == pytest.approx(expected, abs=1e-9)
        better = np.flatnonzero(gain > 1e-10)
        assert tried[better, new[better]] == pytest.approx(tried[better].min(axis=1), rel=1e-9)
        exchanged += len(better)
        prices.replace(better, place, new[better])
        places[better, place] = new[better]
    assert exchanged > 5
    ones = pricing.scores(PLACES, 0.0)
    assert -1 / ones == pytest.approx(criterion.cost(scatter.information(PLACES)), rel=1e-9)


def test_a_ridge_is_information_of_every_place():
    """With a ridge, singular plans have the prices of plans with so much of the mean added."""
    one = np.zeros((1, M), dtype=int)
    none = Limits(M, np.zeros((P, P)))
    prices = DeterminantPricing(ROWS, none).prices(one, 1e-3, 0)
    expected = np.linalg.inv(M * np.outer(ROWS[0], ROWS[0]) + 1e-3 * M * np.eye(P))
    assert prices.cov[0] == pytest.approx(expected, rel=1e-9)


def corners(k: int, low: float, high: float) -> np.ndarray:
    """A constant and all corners of a cube, in a random order."""
    bits = (np.arange(2**k)[:, None] >> np.arange(k)) & 1
    cube = np.where(bits, high, low)
    return RNG.permutation(np.hstack([np.full((2**k, 1), 2.0), cube]))


def test_corners_are_known_whatever_their_order_and_levels():
    """Corners of a cube are told from a cube without one, and from three levels."""
    rows = corners(4, -0.5, 3.0)
    found = two_levels(rows)
    assert found is not None
    order, movable = found
    assert movable.tolist() == [1, 2, 3, 4]
    assert sorted(order.tolist()) == list(range(16))
    assert two_levels(rows[:-1]) is None
    assert two_levels(np.vstack([rows[:-1], rows[:1]])) is None
    assert two_levels(np.where(rows == 3.0, RNG.normal(size=rows.shape), rows)) is None


def test_the_best_corner_is_found_without_a_look_at_all():
    """Of a saturated plan the corner along the cofactors is the best of all corners."""
    rows = corners(5, -1.0, 1.0)
    found = two_levels(rows)
    assert found is not None
    p = rows.shape[1]
    limits = Limits(p, np.zeros((p, p)))
    rng = np.random.default_rng(0)
    places = rng.integers(0, len(rows), size=(20, p))
    places = places[np.abs(np.linalg.det(rows[places])) > 1e-6]
    assert len(places) > 5
    every = DeterminantPricing(rows, limits).prices(places, 0.0, 0)
    cube = TwoLevelPricing(rows, limits, *found).prices(places, 0.0, 0)
    for place in range(p):
        assert cube.best(place, None)[1] == pytest.approx(every.best(place, None)[1], abs=1e-8)


def test_a_criterion_linear_in_the_covariance_is_known_by_its_gradient():
    """A, I and the root rho0 have a constant slope; D, E, G, O2, O4 and O5 have not."""
    mean = BASE + np.eye(P)
    assert constant_slope(criteria.create("A"), mean) == pytest.approx(np.eye(P), abs=1e-9)
    found = constant_slope(criteria.create("I", W=SLOPE), mean)
    assert found == pytest.approx(SLOPE, rel=1e-9)
    for name in ("D", "E", "G", "O2", "O4", "O5"):
        assert constant_slope(criteria.create(name), mean) is None
    target = RNG.normal(size=(3, P))
    found = constant_slope(criteria.create("rho0", target), mean)
    assert found == pytest.approx(target.T @ target, rel=1e-9)


def test_every_criterion_has_its_quickest_prices():
    """One row and a determinant, a trace, a largest variance or eigenvalue, and all the rest."""
    scatter = Scatter(ROWS[:, None], LIMITS)
    mean = BASE + np.eye(P)
    assert type(pricing_for(criteria.create("D"), scatter, mean)) is DeterminantPricing
    assert type(pricing_for(criteria.create("A"), scatter, mean)) is LinearPricing
    assert type(pricing_for(criteria.create("E"), scatter, mean)) is LeastEigenvaluePricing
    assert type(pricing_for(criteria.create("G"), scatter, mean)) is LargestVariancePricing
    assert type(pricing_for(criteria.create("O4"), scatter, mean)) is AnyPricing
    two = Scatter(RNG.normal(size=(12, 2, P)), LIMITS)
    assert type(pricing_for(criteria.create("D"), two, mean)) is AnyPricing
