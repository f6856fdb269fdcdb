"""Simulated measurements."""

import numpy as np
import pytest

from edtk.fit.measurements import simulate

A = np.random.default_rng(0).normal(size=(4, 3, 2))
K = [1.0, -2.0]


def test_without_noise_is_the_model():
    """Noise of no size leaves Eq. (3)'s deflections."""
    clean = simulate(A, K, 0.0, np.random.default_rng(1), runs=3)
    np.testing.assert_array_equal(clean, np.broadcast_to(A @ K, (3, 4, 3)))


def test_seed():
    """The seed decides the noise."""
    first, again, other = (simulate(A, K, 1.0, np.random.default_rng(s)) for s in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).all()


@pytest.mark.parametrize("sigma", [0.3, [0.1, 0.2, 0.7]], ids=["one", "per row"])
def test_noise(sigma):
    """Noise is unbiased, of the standard deviation asked for, and independent between rows.

    Over N runs of 12 standardised entries a mean or a correlation has standard error 1/sqrt(N).
    """
    N = 20_000
    noise = (simulate(A, K, sigma, np.random.default_rng(3), runs=N) - A @ K) / np.broadcast_to(
        sigma, 3
    )
    z = noise.reshape(N, 12)
    assert np.abs(z.mean(axis=0)).max() * np.sqrt(N) < 4.5
    second = (
        (z.T @ z / N - np.eye(12)) * np.sqrt(N) / np.where(np.eye(12, dtype=bool), np.sqrt(2), 1)
    )
    assert np.abs(second).max() < 4.5
