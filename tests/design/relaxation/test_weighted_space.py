"""Weights of experiments as variables: what they tell, and derivatives by them."""

import numpy as np
from designs import KR270

from edtk.design.candidate_source import sample_feasible
from edtk.design.relaxation.settle import WeightedSpace

K = 4
STEP = 1e-6


def weighted(seed=0):
    """A space of weighted poses, and four of them (1, 4, v + 1)."""
    x = sample_feasible(KR270, K, seed)
    w = np.array([0.1, 0.2, 0.3, 0.4])
    return WeightedSpace(KR270, K), np.concatenate([x, w[:, None]], axis=1)[None]


def test_weights_of_sum_one_are_a_relaxed_design():
    """Each pose, measured 1/k times, tells ``w A'A`` of the pose alone; a prior counts once."""
    space, x = weighted()
    blocks = KR270.problem(x[0, :, :-1]).blocks()
    M = np.tensordot(x[0, :, -1], blocks, 1)
    prior = np.diag(np.diag(M))
    each = np.full((1, K), 1.0 / K)
    np.testing.assert_allclose(space.at(x).information(each)[0], M, rtol=1e-12)
    beside = WeightedSpace(KR270.with_kept(prior, 1), K)
    np.testing.assert_allclose(beside.at(x).information(each)[0], M + prior, rtol=1e-12)
    packed = space.at(x).packed
    np.testing.assert_allclose(packed[0, 0] / K, x[0, :, -1] * blocks[:, 0, 0], rtol=1e-12)


def test_slopes():
    """Derivatives by poses and weights are those of differences."""
    space, x = weighted(1)
    B = np.random.default_rng(0).standard_normal(space.at(x).regressor.shape)
    slope = space.at(x).slope(B)
    for j in space.movable:
        ahead, behind = x.copy(), x.copy()
        ahead[..., j] += STEP
        behind[..., j] -= STEP
        change = space.at(ahead).regressor - space.at(behind).regressor
        by_difference = (B * change).sum(axis=(-1, -2)) / (2 * STEP)
        size = np.abs(slope[..., j]).max()
        np.testing.assert_allclose(slope[..., j], by_difference, rtol=0, atol=1e-6 * size)


def test_a_weight_of_zero_has_a_slope():
    """Where a weight vanishes, its rows do, and the slope is finite."""
    space, x = weighted()
    x[0, 0, -1] = 0.0
    here = space.at(x)
    assert np.isfinite(here.slope(here.regressor)).all()
    assert here.feasible.all()
    x[0, 0, -1] = -1e-9
    assert not space.at(x).feasible[0, 0]
