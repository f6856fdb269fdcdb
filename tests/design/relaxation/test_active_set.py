"""The relaxation over a few poses, and the merging of poses that tell the same."""

from dataclasses import replace

import numpy as np
import pytest
from designs import KR270, symmetric

from criteria import create
from criteria.linalg.inverse import whitener
from edtk.design.candidate_source import Candidates, sample_feasible
from edtk.design.problem import Problem
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.relax_poses import ActiveSet

pytestmark = pytest.mark.slow

GAP = 1e-8


def active_over(poses, criterion, gap=GAP):
    r = relax(poses.problem, criterion, gap)
    return ActiveSet(poses, r, r.iterations)


def polynomial(x, degree=2):
    """Regression on points x, as poses of one joint."""
    x = np.asarray(x)
    return Candidates(x[:, None], Problem(np.vander(x, degree + 1, increasing=True)[:, None, :]))


def pairs(active):
    """Relative distances between the whitened information of the poses of a support."""
    T = whitener(active.support.problem.information(active.weights))
    W = (T.T @ active.support.problem.blocks() @ T).reshape(len(active.weights), -1)
    away = np.linalg.norm(W[:, None] - W, axis=-1) / np.linalg.norm(W, axis=-1)
    return away[~np.eye(len(W), dtype=bool)]


@pytest.mark.parametrize(
    ("name", "weights"),
    [("D", [1 / 3, 1 / 3, 1 / 3]), ("A", [1 / 4, 1 / 2, 1 / 4]), ("E", [1 / 5, 3 / 5, 1 / 5])],
)
def test_points_that_are_all_but_the_same_become_one(name, weights):
    """Of three copies of every point of quadratic regression one stays, with all their weight.

    The points differ by 1e-5, and with them the least cost and the weights by about as much.
    Besides, weights are as accurate as the root of the gap, as the cost is quadratic about its
    optimum.
    """
    x = np.concatenate(
        [[-1, 0, 1, -0.5, 0.5], [-1 + 1e-5, 1e-5, 1 - 1e-5], [-1 + 2e-5, -1e-5, 1 - 2e-5]]
    )
    whole = active_over(polynomial(x), create(name))
    merged = whole.merged(loss=1e-3, gap=GAP)
    order = np.argsort(merged.support.x[:, 0])
    np.testing.assert_allclose(merged.support.x[order, 0], [-1, 0, 1], rtol=0, atol=2e-5)
    np.testing.assert_allclose(merged.weights[order], weights, rtol=0, atol=2 * np.sqrt(GAP))
    assert merged.relaxation.cost <= whole.relaxation.cost * (1 + 1e-3)


def test_the_point_that_joined_last_stays():
    """Of equal points that share the weight the later one stays, which a search found last."""
    poses = polynomial([-1, 0, 1]) + polynomial([-1, 0, 1])
    r = relax(poses.problem, create("D"), GAP)
    shared = np.full(6, 1 / 6)
    relaxation = replace(r, weights=shared)
    numbered = Candidates(np.arange(6.0)[:, None], poses.problem)
    merged = ActiveSet(numbered, relaxation, 1).merged(1e-6, GAP)
    assert sorted(merged.support.x[:, 0]) == [3, 4, 5]


@pytest.mark.parametrize("name", ["A", "D", "E", "G", "rho0"])
@pytest.mark.parametrize("loss", [1e-6, 1e-2])
def test_merging_costs_no_more_than_the_loss(name, loss):
    """Of poses with all symmetric copies few remain, no two alike, at no more than the loss."""
    q = np.concatenate([symmetric(x) for x in sample_feasible(KR270, 25, 1)])
    criterion = create(name, np.random.default_rng(0).normal(size=(3, 5)))
    whole = active_over(Candidates(q, KR270.problem(q)), criterion)
    merged = whole.merged(loss, GAP)
    assert merged.relaxation.cost <= whole.relaxation.cost * (1 + loss)
    assert merged.relaxation.cost >= whole.relaxation.proved_bound.cost * (1 - 1e-9)
    assert len(merged.weights) <= 15 + 1
    assert pairs(merged).min() > 1e-6
    assert (merged.weights > 0).all()
    assert merged.weights.sum() == pytest.approx(1, abs=1e-12)


def test_like_points_stay_where_merging_costs_too_much():
    """Alike points merge only as far as the loss allows.

    Cubic regression without its points +-1/sqrt(5) rests on those to either side, and one of each
    pair costs 2e-4 more. The information of a pair (0.43, 0.47) differs by less than a tenth.
    """
    whole = active_over(polynomial([-1, -0.47, -0.43, 0.43, 0.47, 1], degree=3), create("D"))
    assert len(whole.weights) == 6
    assert whole.merged(1e-5, GAP) is whole
    merged = whole.merged(1e-2, GAP)
    assert len(merged.weights) == 4
    assert 1 + 1e-5 < merged.relaxation.cost / whole.relaxation.cost < 1 + 1e-2


def test_a_pose_of_little_weight_that_is_needed_stays():
    """Where a weight of 1e-4 is all that identifies a parameter, it is not dropped."""
    blocks = np.zeros((2, 1, 2))
    blocks[0, 0, 0] = 1.0
    blocks[1, 0, 1] = 1e4
    poses = Candidates(np.arange(2.0)[:, None], Problem(blocks))
    merged = active_over(poses, create("A")).merged(0.1, GAP)
    light = 1e-4 / (1 + 1e-4)  # A's weights are as the standard deviations
    np.testing.assert_allclose(merged.weights, [1 - light, light], rtol=0, atol=1e-6)


def test_nothing_to_merge():
    """A support of few and unlike poses comes back as it is."""
    whole = active_over(polynomial([-1, -0.5, 0, 0.5, 1]), create("D"))
    support = active_over(whole.support, create("D"))
    assert support.merged(1e-3, GAP) is support


def test_over_other_poses():
    """More poses never cost more, and the masters are counted from the beginning."""
    few = active_over(polynomial([-1, -0.3, 0.4, 1]), create("A"))
    more = few.over(few.poses + polynomial([0.0]), GAP)
    assert more.relaxation.cost == pytest.approx(8, rel=10 * GAP)
    assert more.relaxation.cost < few.relaxation.cost
    assert more.iterations == few.iterations + more.relaxation.iterations
    np.testing.assert_array_equal(np.sort(more.support.x[:, 0]), [-1, 0, 1])
