"""Prices of several models in their blocks, against one matrix of all parameters."""

import numpy as np
import pytest

import criteria
from criteria.linalg.models import Models
from edtk.design.exact.counts.any_prices import AnyPricing
from edtk.design.exact.counts.counts_bound import Scatter
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.mean_variance_prices import MeanVariancePricing
from edtk.design.exact.counts.models_prices import ModelScatter, ModelsPricing
from edtk.design.exact.counts.pricing_for import pricing_for, scatter_for
from edtk.design.information import side_by_side

RNG = np.random.default_rng(5)
SIZES = (2, 3, 2, 2)
P = sum(SIZES)
N = 80
M = 6
# The third model has two measurements where the others have one.
ROWS = side_by_side([RNG.normal(size=(N, 1 + (j == 2), s)) for j, s in enumerate(SIZES)])
NONE = Limits(M, np.zeros((P, P)))
PARTS = ("D", "A", "D", "D")


def criterion_of(name):
    """D in three models and A in one, as a mean or a maximum."""
    return criteria.create(name, criteria=list(PARTS), sizes=SIZES, best=[0.5, 2.0, 1.0, 3.0])


def plans(b):
    """Plans (b, m) of distinct places, which tell all parameters."""
    return np.array([RNG.choice(N, M, replace=False) for _ in range(b)])


def test_information_in_blocks_is_that_of_all_rows():
    """Blocks of models are summed alone, with the same sums, and zeros beside them."""
    places = plans(4)
    one = Scatter(ROWS, NONE).information(places)
    own = ModelScatter(ROWS, NONE, Models(SIZES)).information(places)
    np.testing.assert_allclose(own, one, rtol=1e-13, atol=1e-13)
    own_rows = [ROWS[:, :, part] for part in Models(SIZES).parts]
    apart = ModelScatter([rows[:, rows.any(axis=(0, 2))] for rows in own_rows], NONE, Models(SIZES))
    np.testing.assert_allclose(apart.information(places), one, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("place", [0, M - 1])
def test_what_is_left_without_an_experiment_is_that_of_one_matrix(place):
    """Block by block, as of the rows of all models together."""
    places = plans(4)
    information = Scatter(ROWS, NONE).information(places)
    one, _, share = Scatter(ROWS, NONE).without(information, places, place)
    own, _, same = ModelScatter(ROWS, NONE, Models(SIZES)).without(information, places, place)
    np.testing.assert_allclose(own, one, rtol=1e-12, atol=1e-12)
    assert share == same == 1.0


@pytest.mark.parametrize("name", ["compound", "minimax"])
@pytest.mark.parametrize("ridge", [0.0, 1e-6])
def test_the_best_exchange_is_that_of_one_matrix(name, ridge):
    """A look at all candidates finds the cost of each sum; short lists never find a better one."""
    criterion = criterion_of(name)
    mean = Scatter(ROWS, NONE).information(np.arange(N)[None])[0] / N
    pricing = pricing_for(criterion, scatter_for(criterion, [ROWS], NONE), mean)
    assert type(pricing) is ModelsPricing
    every = AnyPricing(criterion, Scatter(ROWS, NONE), mean)
    places = plans(3)
    if ridge:
        places[1] = places[1, 0]  # a singular plan
    own = pricing.prices(places, ridge, pricing.rounds[-1])
    short = pricing.prices(places, ridge, pricing.rounds[0])
    for place in range(M):
        trials = np.repeat(places[:, None], N, axis=1)
        trials[:, :, place] = np.arange(N)
        costs = criterion.cost(every.information(trials.reshape(-1, M), ridge)).reshape(3, N)
        new, gain = own.best(place, None)
        expected = 1 - costs.min(axis=1) / criterion.cost(every.information(places, ridge))
        np.testing.assert_allclose(costs[np.arange(3), new], costs.min(axis=1), rtol=1e-9)
        np.testing.assert_allclose(gain, expected, atol=1e-9)
        assert (short.best(place, None)[1] <= gain + 1e-9).all()


@pytest.mark.parametrize("ridge", [0.0, 1e-6])
def test_exchanges_under_a_sum_of_variances_are_those_of_one_matrix(ridge):
    """Over a sweep, the best candidate and its gain are those of a look at the whole matrix."""
    rows = [RNG.normal(size=(N, 1, 3)) for _ in range(4)]
    models = Models((3,) * 4)
    base = models.diagonal([np.diag(RNG.random(3)) for _ in range(4)])
    limits = Limits(M, base)
    roots = [RNG.normal(size=(3, 2)) for _ in range(4)]
    criterion = criteria.create("I", root=models.diagonal(roots))
    scatter = scatter_for(criterion, rows, limits, models)
    whole = Scatter(side_by_side(rows), limits)
    mean = whole.information(np.arange(N)[None])[0] / N
    pricing = pricing_for(criterion, scatter, mean)
    assert type(pricing) is MeanVariancePricing
    every = AnyPricing(criterion, whole, mean)
    places = plans(3)
    if ridge:
        places[1] = places[1, 0]  # a singular plan, but for the base
    prices = pricing.prices(places, ridge, 0)
    for place in range(M):
        trials = np.repeat(places[:, None], N, axis=1)
        trials[:, :, place] = np.arange(N)
        allowed = RNG.random((3, N)) < 0.8
        costs = criterion.cost(every.information(trials.reshape(-1, M), ridge)).reshape(3, N)
        costs[~allowed] = np.inf
        present = criterion.cost(every.information(places, ridge))
        new, gain = prices.best(place, allowed)
        np.testing.assert_allclose(costs[np.arange(3), new], costs.min(axis=1), rtol=1e-9)
        np.testing.assert_allclose(gain, 1 - costs.min(axis=1) / present, atol=1e-9)
        better = np.flatnonzero(gain > 0)
        prices.replace(better, place, new[better])
        places[better, place] = new[better]
    np.testing.assert_allclose(
        pricing.scores(places, ridge), every.scores(places, ridge), rtol=1e-9
    )


def test_sums_of_variances_across_models_keep_one_matrix():
    """Of a slope that mixes models, or of several rows, the prices are the general ones."""
    mean = Scatter(ROWS, NONE).information(np.arange(N)[None])[0] / N
    own_rows = [ROWS[:, :, part] for part in Models(SIZES).parts]
    each = [rows[:, rows.any(axis=(0, 2))] for rows in own_rows]
    criterion = criteria.create("A")
    pricing = pricing_for(criterion, scatter_for(criterion, each, NONE, Models(SIZES)), mean)
    assert type(pricing) is not MeanVariancePricing


def test_blocks_of_time_and_priors_across_models_keep_one_matrix():
    """What mixes the models has no blocks: the general prices serve it."""
    criterion = criterion_of("compound")
    mixed = Limits(M, np.ones((P, P)))
    in_blocks = Limits(M, np.zeros((P, P)), blocks=(3, 3))
    assert type(scatter_for(criterion, [ROWS], mixed)) is Scatter
    assert type(scatter_for(criterion, [ROWS], in_blocks)) is Scatter
    assert type(scatter_for(criteria.create("A"), [ROWS], NONE)) is Scatter


def test_models_whose_criteria_differ_by_a_number_stay_alike():
    """D of other parameters is a multiple of D: all three are still computed together."""
    criterion = criterion_of("minimax")
    blocks = [RNG.normal(size=(s, s)) for s in SIZES]
    T = Models(SIZES).diagonal(blocks)
    other = criterion.transformed(T)
    assert sorted(len(each.numbers) for each in other.alike) == [1, 3]
    assert sorted(len(each.numbers) for each in criterion.alike) == [1, 3]
    information = Scatter(ROWS, NONE).information(plans(3))
    np.testing.assert_allclose(other.cost(T.T @ information @ T), criterion.cost(information))
