"""Draws from a normal distribution confined to positive numbers."""

import numpy as np
import pytest
from scipy import stats

from edtk.fit.prior import draw_positive


@pytest.mark.parametrize("mean", [1.0, -2.0, -30.0])
def test_one_number(mean):
    """One number has the law of the truncated normal, also far in its tail."""
    x = draw_positive(np.array([mean]), np.array([[1.0]]), 4000, np.random.default_rng(0))
    assert stats.kstest(x[:, 0], stats.truncnorm(-mean, np.inf, loc=mean).cdf).pvalue > 1e-3


@pytest.mark.slow
def test_two_correlated_numbers():
    """Two correlated numbers have the law of normal draws of which the positive ones are kept."""
    covariance = np.array([[1.0, -0.7], [-0.7, 1.0]])
    mean = np.array([0.5, -0.3])
    rng = np.random.default_rng(1)
    x = draw_positive(mean, np.linalg.inv(covariance), 4000, rng)
    kept = rng.multivariate_normal(mean, covariance, 60_000)
    kept = kept[(kept > 0).all(axis=1)]
    for of in (lambda v: v[:, 0], lambda v: v[:, 1], lambda v: v.sum(axis=1)):
        assert stats.ks_2samp(of(x), of(kept)).pvalue > 1e-3
