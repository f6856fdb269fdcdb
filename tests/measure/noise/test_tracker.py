"""The tracker's covariance: its formula, its symmetries and its slope."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from edtk.measure.noise import Tracker

RNG = np.random.default_rng(0)
TRACKER = Tracker(np.array([3.0, -2.0, 1.5]), (1e-5, 5e-6), (1.5e-5, 6e-6))
POINTS = RNG.normal(size=(4, 3, 5))


def test_along_and_across():
    """Along the beam the variance is (a + b r)^2 of `along`, in all directions across the other."""
    T = TRACKER.covariance(POINTS)
    for m, k in np.ndindex(4, 5):
        beam = POINTS[m, :, k] - TRACKER.position
        r = np.linalg.norm(beam)
        own = np.linalg.eigh(T[m, :, :, k])
        along = beam @ T[m, :, :, k] @ beam / r**2
        assert along == pytest.approx((1e-5 + 5e-6 * r) ** 2, rel=1e-12)
        across = (1.5e-5 + 6e-6 * r) ** 2
        np.testing.assert_allclose(np.sort(own[0]), np.sort([along, across, across]), rtol=1e-9)


def test_rotation():
    """A tracker and points that turn and move together have the turned covariance."""
    R = Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix()
    t = np.array([1.0, 2.0, -3.0])
    moved = Tracker(R @ TRACKER.position + t, TRACKER.along, TRACKER.across)
    T = moved.covariance(np.einsum("ij,mjk->mik", R, POINTS) + t[:, None])
    expected = np.einsum("ij,mjlk,nl->mink", R, TRACKER.covariance(POINTS), R)
    np.testing.assert_allclose(T, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("across", [(1.5e-5, 6e-6), (1e-5, 5e-6), (0.0, 0.0)])
def test_slope(across, derivative):
    """The derivative of <S, T> by the points is its finite difference."""
    tracker = Tracker(TRACKER.position, TRACKER.along, across)
    S = RNG.normal(size=(1, 3, 3))
    S = S + S.swapaxes(1, 2)
    for point in POINTS[:, :, 0]:
        slope = tracker.slope(point[None], S)[0]
        expected = derivative(
            lambda p: np.array([(S * tracker.covariance(p[None]) * 1e10).sum()]), point
        )[0]
        np.testing.assert_allclose(slope * 1e10, expected, rtol=0, atol=1e-8)
