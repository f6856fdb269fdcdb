"""The verdict of the study that checks the sampler, and its check of Eq. (13)."""

import numpy as np
import pytest


@pytest.fixture(scope="module")
def check(script):
    return script("calibration_check.py")


def test_verdict(check):
    """A case holds with uniform ranks and 95 % coverage, and not if one parameter is off."""
    p = np.full(5, 0.3)
    covered = np.full(5, 0.95)
    assert check.verdict_of(p, covered, 500).holds
    assert not check.verdict_of(p * [1, 1, 1, 1, 1e-3], covered, 500).holds
    assert not check.verdict_of(p, covered - 0.03, 500).holds
    assert not check.verdict_of(p, covered - [0, 0, 0, 0, 0.05], 500).holds


def test_least_squares(check, monkeypatch):
    """Eq. (13) with the right sigma passes, and with one that is five percent wrong does not."""
    A = np.random.default_rng(0).normal(size=(5, 3, 2))
    rng = np.random.default_rng(1)
    k = np.array([1.0, 2.0])
    sigma = np.full(3, 0.1)
    assert check.least_squares(A, sigma, k, rng, 5000)[1] > 1e-3
    right = check.simulate

    def noisier(A, k, sigma, rng, runs):
        return right(A, k, 1.05 * sigma, rng, runs)

    monkeypatch.setattr(check, "simulate", noisier)
    assert check.least_squares(A, sigma, k, rng, 5000)[1] < 1e-3
