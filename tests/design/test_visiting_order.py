"""Orders of poses: complete, and short."""

from itertools import permutations

import numpy as np
import pytest

from edtk.design.tours import visiting_order


def length(x, order):
    return np.linalg.norm(np.diff(x[list(order)], axis=0), axis=1).sum()


@pytest.mark.parametrize("k", [1, 2, 3, 6])
def test_few_poses_in_the_best_order(k):
    """Up to eleven poses no permutation is shorter."""
    x = np.random.default_rng(k).normal(size=(k, 4))
    best = min(length(x, order) for order in permutations(range(k)))
    assert length(x, visiting_order(x, np.ones(4))) == pytest.approx(best, abs=1e-12)


@pytest.mark.parametrize("k", [11, 12, 60])
def test_points_on_a_line(k):
    """Points on a line are visited from end to end, from that end which comes first."""
    x = np.random.default_rng(k).permutation(k)[:, None] * [1.0, 2.0]
    order = visiting_order(x, np.ones(2))
    assert np.abs(np.diff(x[order, 0])).tolist() == [1] * (k - 1)
    assert order[0] < order[-1]


def test_exchanges_come_near_the_best():
    """With exchanges the path is within a fifth of the best."""
    for seed in range(20):
        x = np.random.default_rng(seed).normal(size=(9, 3))
        best = length(x, visiting_order(x, np.ones(3)))
        found = length(x, visiting_order(x, np.ones(3), best_up_to=0))
        assert best <= found + 1e-12 <= 1.2 * best + 1e-9


@pytest.mark.parametrize("k", [2, 3, 50, 400])
def test_very_many_poses(k):
    """From the shortest legs on, the path is no longer than by nearest neighbour."""
    x = np.random.default_rng(k).normal(size=(k, 6))
    left = list(range(1, k))
    nearest = [0]
    while left:
        nearest.append(min(left, key=lambda i: float(np.linalg.norm(x[i] - x[nearest[-1]]))))
        left.remove(nearest[-1])
    order = visiting_order(x, np.ones(6), best_up_to=0, exchanges_up_to=0)
    assert sorted(order.tolist()) == list(range(k))
    assert length(x, order) <= length(x, nearest) + 1e-9


def test_travel_counts_by_range():
    """A joint of wide range may travel more: it is the fraction of the range that counts."""
    q = np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 1.0], [10.0, 1.0]])
    assert length(q / [100, 1], visiting_order(q, np.array([100.0, 1.0]))) == pytest.approx(1.2)
    assert length(q, visiting_order(q, np.array([1.0, 1.0]))) == pytest.approx(12)


@pytest.mark.parametrize("k", [5, 200, 400])
def test_every_pose_once(k):
    """All poses are visited, equal ones too."""
    q = np.random.default_rng(0).integers(0, 3, size=(k, 4)) * 1.0
    assert sorted(visiting_order(q, np.ones(4)).tolist()) == list(range(k))
