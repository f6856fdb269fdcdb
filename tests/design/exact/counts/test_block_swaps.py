"""Swaps of experiments in different blocks against the plans that they lead to."""

import numpy as np
import pytest

import criteria
from edtk.design.exact.counts.counts_bound import Scatter
from edtk.design.exact.counts.joint_exchanges import BlockSwaps, swap_between_blocks
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.prices import GAIN

SIZES = (3, 4, 2)
P = 3
TOLD = 1e6  # condition number up to which costs are compared


def swapped(places, place, other):
    """Plans (b, m) with the experiments of two places swapped."""
    trials = places.copy()
    trials[:, [place, other]] = places[:, [other, place]]
    return trials


def pairs(limits):
    """All pairs of places in different blocks."""
    block = limits.block_of
    return [(i, j) for i in range(len(block)) for j in range(len(block)) if block[i] != block[j]]


@pytest.mark.parametrize("name", criteria.available())
@pytest.mark.parametrize("variance", [0.3, np.inf])
@pytest.mark.parametrize("r", [1, 2])
def test_a_swap_costs_what_the_plan_then_costs(name, variance, r):
    """Low-rank updates tell the costs of all swaps, in blocks of several sizes."""
    rng = np.random.default_rng(r)
    limits = Limits(9, np.zeros((P, P)), blocks=SIZES, block_variance=variance)
    scatter = Scatter(rng.normal(size=(8, r, P)), limits)
    criterion = criteria.create(name, rng.normal(size=(2, P))).plan_criterion
    places = rng.integers(0, 8, size=(6, 9))
    swaps = BlockSwaps(criterion, scatter, places)
    for place, other in pairs(limits):
        M = scatter.information(swapped(places, place, other))
        found = swaps.costs_at(place)[:, other]
        told = np.linalg.cond(M) < TOLD
        np.testing.assert_allclose(found[told], criterion.cost(M)[told], rtol=1e-9)


@pytest.mark.parametrize("name", ["D", "A", "E"])
def test_no_swap_improves_a_plan_that_was_swapped(name):
    """Plans become no worse, keep their experiments, and are the best of all one swap away."""
    rng = np.random.default_rng(4)
    limits = Limits(9, np.zeros((P, P)), blocks=SIZES)
    scatter = Scatter(rng.normal(size=(8, 1, P)), limits)
    criterion = criteria.create(name).plan_criterion
    places = rng.integers(0, 8, size=(10, 9))
    found = swap_between_blocks(criterion, scatter, places)
    costs = criterion.cost(scatter.information(found))
    assert (np.sort(found) == np.sort(places)).all()
    assert (costs < criterion.cost(scatter.information(places))).any()
    for place, other in pairs(limits):
        reached = criterion.cost(scatter.information(swapped(found, place, other)))
        assert (reached >= costs * (1 - 2 * GAIN)).all()
