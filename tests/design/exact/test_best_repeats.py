"""Repetitions of a few poses against enumeration."""

from itertools import product

import numpy as np
import pytest

import criteria
from edtk.design.exact.apportion import best_repeats

EPS = np.finfo(float).eps


def case(seed):
    """Information of three or four poses of two rows, three parameters, and a target."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(rng.integers(3, 5), 2, 3)) * rng.uniform(0.3, 1, size=(1, 1, 3))
    return rng, np.swapaxes(A, 1, 2) @ A, rng.normal(size=(2, 3))


def cost(criterion, blocks, repeats):
    """Costs (...) of repetitions (..., k)."""
    return criterion.cost(np.tensordot(repeats, blocks, 1))


def every(m, k):
    """All whole numbers (n, k) that sum to m."""
    return np.array([r for r in product(range(m + 1), repeat=k) if sum(r) == m])


@pytest.mark.parametrize("name", criteria.available())
def test_no_single_move_helps(name):
    """The result has whole numbers of the same sum, and no single move improves it.

    A move that gains less than 1e-12 ends the search; the cost itself is known to 64 p eps cond.
    """
    for seed in range(10):
        rng, blocks, A0 = case(seed)
        criterion = criteria.create(name, A0)
        k = len(blocks)
        start = rng.multinomial(9, np.ones(k) / k)
        found = best_repeats(criterion, blocks, start)
        assert found.sum() == 9
        assert (found >= 0).all()
        assert (found == np.round(found)).all()
        reached = cost(criterion, blocks, found)
        assert reached <= cost(criterion, blocks, start)
        slip = 64 * 3 * EPS * np.linalg.cond(np.tensordot(found, blocks, 1))
        for i, j in product(range(k), repeat=2):
            if i != j and found[j] > 0:
                moved = found + np.eye(k)[i] - np.eye(k)[j]
                assert cost(criterion, blocks, moved) >= reached * (1 - 1e-12 - slip)


@pytest.mark.parametrize("name", criteria.available())
def test_against_enumeration(name):
    """From an even start the best distribution of eight measurements is found in nine of ten
    cases.

    A move takes one measurement only, so that a cost with kinks, or one that is not convex, can
    end in a trap.
    """
    off = []
    for seed in range(10):
        _, blocks, A0 = case(seed)
        criterion = criteria.create(name, A0)
        k = len(blocks)
        best = cost(criterion, blocks, every(8, k)).min()
        start = np.diff(np.round(np.linspace(0, 8, k + 1)))
        off.append(cost(criterion, blocks, best_repeats(criterion, blocks, start)) / best - 1)
    assert min(off) >= -1e-9
    assert sum(x <= 1e-9 for x in off) >= 9, off


def test_known_answer():
    """The variances 9/r_1 + 1/r_2 of eight measurements are least with six in the first pose."""
    criterion = criteria.create("A")
    blocks = np.stack([np.diag([1 / 9, 0.0]), np.diag([0.0, 1.0])])
    for start in ([1, 7], [7, 1], [4, 4], [0, 8]):
        assert best_repeats(criterion, blocks, np.array(start)).tolist() == [6, 2]


def test_a_singular_start_is_left():
    """From a singular start, one move away from a regular one, the best plan is reached."""
    _, blocks, _ = case(0)
    criterion = criteria.create("D")
    found = best_repeats(criterion, blocks, np.eye(len(blocks))[0] * 6)
    assert np.isfinite(cost(criterion, blocks, found))
    assert cost(criterion, blocks, found) == pytest.approx(
        cost(criterion, blocks, every(6, len(blocks))).min()
    )


def test_where_nothing_can_be_told():
    """A start with no regular plan one move away comes back unchanged, as does a single pose."""
    blocks = np.eye(4)[:, :, None] * np.eye(4)[:, None]
    start = np.array([4, 0, 0, 0])
    assert best_repeats(criteria.create("A"), blocks, start).tolist() == start.tolist()
    assert best_repeats(criteria.create("A"), np.eye(2)[None], np.array([5])).tolist() == [5]


def test_the_start_is_not_changed():
    """The caller's array stays as it was."""
    start = np.array([1, 7])
    best_repeats(
        criteria.create("A"), np.stack([np.diag([1 / 9, 0.0]), np.diag([0.0, 1.0])]), start
    )
    assert start.tolist() == [1, 7]


@pytest.mark.parametrize("name", ["rho0", "D", "E"])
def test_very_many_measurements(name):
    """A hundred thousand measurements are distributed as a thousand are, and no move helps."""
    _, blocks, A0 = case(3)
    criterion = criteria.create(name, A0)
    k = len(blocks)
    few, many = (best_repeats(criterion, blocks, np.bincount([0], [m], k)) for m in (1000, 100_000))
    assert many.sum() == 100_000
    np.testing.assert_allclose(many / 100, few, atol=3)
    reached = cost(criterion, blocks, many)
    moves = np.eye(k)[:, None] - np.eye(k)
    trial = (many + moves).reshape(-1, k)
    assert (cost(criterion, blocks, trial[(trial >= 0).all(axis=1)]) >= reached * (1 - 1e-9)).all()


@pytest.mark.parametrize("name", ["E", "rho0", "O4"])
def test_equal_poses_end(name):
    """Poses of the same information, but for rounding, are not exchanged for ever."""
    for seed in range(60):
        rng, blocks, A0 = case(seed)
        twins = blocks[[0, 1, 1, 0]] * (1 + 1e-15 * rng.integers(-4, 5, size=(4, 1, 1)))
        found = best_repeats(criteria.create(name, A0), twins, np.array([6, 6, 6, 6]))
        assert found.sum() == 24
