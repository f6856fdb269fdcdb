"""Information beside effects of blocks against the model that has these effects as parameters."""

import numpy as np
import pytest

import criteria
from edtk.design.exact.counts.counts_bound import Scatter, beside_blocks
from edtk.design.exact.counts.limits import Limits
from edtk.design.problem import Problem

RNG = np.random.default_rng(5)
SIZES = (3, 4, 2)
P = 3


def with_effects(rows, places, variance):
    """Information about the parameters where the effects are parameters with a prior."""
    r = rows.shape[1]
    block = np.repeat(np.arange(len(SIZES)), SIZES)
    effects = np.zeros((len(places), r, r * len(SIZES)))
    for i, b in enumerate(block):
        effects[i, :, r * b : r * (b + 1)] = np.eye(r)
    A = np.concatenate([rows[places], effects], axis=2).reshape(-1, P + effects.shape[2])
    M = A.T @ A
    M[P:, P:] += np.eye(effects.shape[2]) / variance
    return M[:P, :P] - M[:P, P:] @ np.linalg.solve(M[P:, P:], M[P:, :P])


@pytest.mark.parametrize("variance", [0.3, np.inf])
@pytest.mark.parametrize("r", [1, 2])
def test_scatter_is_the_information_beside_effects(r, variance):
    """Effects of blocks, fixed or random, are eliminated as nuisance parameters are."""
    rows = RNG.normal(size=(8, r, P))
    limits = Limits(9, np.zeros((P, P)), blocks=SIZES, block_variance=variance)
    places = RNG.integers(0, 8, size=(4, 9))
    found = Scatter(rows, limits).information(places)
    expected = [with_effects(rows, own, variance) for own in places]
    assert found == pytest.approx(np.array(expected), abs=1e-10)


@pytest.mark.parametrize("variance", [0.3, np.inf])
def test_an_experiment_is_taken_out_and_put_back(variance):
    """What is left without an experiment, and what each candidate then adds, is the new whole."""
    rows = RNG.normal(size=(8, 2, P))
    limits = Limits(9, np.eye(P), blocks=SIZES, block_variance=variance)
    scatter = Scatter(rows, limits)
    places = RNG.integers(0, 8, size=(4, 9))
    M = scatter.information(places)
    for place in range(9):
        rest, center, scale = scatter.without(M, places, place)
        U = np.sqrt(scale) * (rows[6] - center)
        changed = places.copy()
        changed[:, place] = 6
        whole = rest + np.swapaxes(U, -1, -2) @ U
        assert whole == pytest.approx(scatter.information(changed), abs=1e-10)


@pytest.mark.parametrize("variance", [0.3, np.inf])
def test_one_common_effect_tells_more_than_effects_of_blocks(variance):
    """The question that bounds plans in blocks has more information than any such plan."""
    rows = RNG.normal(size=(8, 1, P))
    limits = Limits(9, np.zeros((P, P)), blocks=SIZES, block_variance=variance)
    question = beside_blocks(Problem(rows), criteria.create("D"), limits)
    assert question is not None
    extended, criterion, free = question
    scatter = Scatter(rows, limits)
    for places in RNG.integers(0, 8, size=(50, 9)):
        counts = np.bincount(places, minlength=8)
        M = extended.information(counts) + free.base
        own = scatter.information(places[None])[0]
        schur = M[:P, :P] - np.outer(M[:P, P], M[P, :P]) / M[P, P]
        assert np.linalg.eigvalsh(schur - own).min() > -1e-10
        assert criterion.cost(M) <= criteria.create("D").cost(own) * (1 + 1e-12)
