"""Visits that share a discrepancy: who counts as near, and that the count is safe."""

import numpy as np

from edtk.measure.noise import shared_visits

TURNS = np.zeros(2, dtype=bool)


def test_own_repeats():
    """Poses that are far apart have their own repeats only."""
    q = np.deg2rad([[0.0, 0.0], [10.0, 0.0], [0.0, 50.0]])
    counts = shared_visits(q, np.array([1, 3, 2]), TURNS, np.deg2rad(5))
    np.testing.assert_array_equal(counts, [1, 3, 2])


def test_near_poses():
    """Nearness is Euclidean, the short way round, and no chain: who is near a neighbour is not."""
    q = np.deg2rad([[179.0, 0.0], [-178.0, 0.0], [-174.5, 0.0], [179.0, 5.0]])
    counts = shared_visits(q, np.ones(4), TURNS, np.deg2rad(5))
    np.testing.assert_array_equal(counts, [2, 3, 2, 1])


def test_loaded_and_unloaded_visits_share_nothing():
    """What bends under a load is no error of a visit without one."""
    q = np.zeros((3, 2))
    wrench = np.array([[0.0, 0, 0, 0, 0, 0], [0, 0, -9.0, 0, 0, 0], [0, 1.0, 0, 0, 0, 0]])
    counts = shared_visits(q, np.array([2, 1, 4]), TURNS, 0.1, wrench)
    np.testing.assert_array_equal(counts, [2, 5, 5])


def test_same_pose():
    """Equal poses share whatever the distance, and prismatic joints do not count."""
    q = np.array([[0.1, 0.3], [0.1, 0.3], [0.1, 0.9]])
    np.testing.assert_array_equal(shared_visits(q, np.ones(3), TURNS, 0.0), [2, 2, 1])
    np.testing.assert_array_equal(
        shared_visits(q, np.ones(3), np.array([False, True]), 0.0), [3, 3, 3]
    )


def test_count_is_safe():
    """Whatever correlations near poses have, GLS knows at least what the counts promise.

    The correlations are spherical, which are sound in up to three dimensions and end at a range.
    """
    rng = np.random.default_rng(0)
    q = rng.uniform(0, 0.3, (12, 2))
    within = 0.12
    A = rng.normal(size=(12, 3))
    counts = shared_visits(q, np.ones(12), TURNS, within)
    assert counts.max() > 3
    promised = A.T @ np.diag(1 / (0.2 + counts)) @ A
    away = np.linalg.norm(q[:, None] - q, axis=-1)
    for length in (0.01, 0.06, within):
        h = np.minimum(away / length, 1.0)
        C = 1 - 1.5 * h + 0.5 * h**3
        true = A.T @ np.linalg.solve(0.2 * np.eye(12) + C, A)
        assert np.linalg.eigvalsh(true - promised)[0] > -1e-12
    # All poses near each other, with one error for all of them.
    np.testing.assert_array_equal(shared_visits(q, np.ones(12), TURNS, 10.0), 12)
    true = A.T @ np.linalg.solve(0.2 * np.eye(12) + 1.0, A)
    assert np.linalg.eigvalsh(true - A.T @ A / 12.2)[0] > -1e-12
