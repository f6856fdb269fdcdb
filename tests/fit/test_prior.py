"""Densities of priors beside scipy's, and draws beside densities."""

import numpy as np
import pytest
from scipy import stats

from edtk.fit.prior import Flat, HalfNormal, LogNormal, Normal, Prior

KNOWN = [
    (HalfNormal(2.0), stats.halfnorm(scale=2.0)),
    (LogNormal(3.0, 1.5), stats.lognorm(np.log(1.5), scale=3.0)),
]


@pytest.mark.parametrize(("marginal", "exact"), KNOWN)
def test_marginals(marginal, exact):
    """Densities are scipy's, zero for negative compliances, and draws follow them."""
    prior = Prior((marginal,))
    k = np.linspace(0.1, 9, 50)
    difference = prior.log_density(k[:, None]) - exact.logpdf(k)
    assert np.ptp(difference) < 1e-12
    assert prior.log_density(np.array([[-1.0], [0.0]])).tolist() == [-np.inf, -np.inf]
    assert stats.kstest(prior.draw(np.random.default_rng(0), 2000)[:, 0], exact.cdf).pvalue > 1e-3


def test_earlier_calibration():
    """An earlier calibration is the multivariate normal law on positive compliances."""
    mean = np.array([0.5, 1.0])
    covariance = np.array([[1.0, 0.3], [0.3, 0.5]])
    prior = Prior((Flat(), Flat()), Normal(mean, covariance))
    k = np.random.default_rng(0).uniform(0.1, 3, (4, 5, 2))
    assert (
        np.ptp(prior.log_density(k) - stats.multivariate_normal(mean, covariance).logpdf(k)) < 1e-12
    )
    draws = prior.draw(np.random.default_rng(1), 500)
    assert draws.shape == (500, 2)
    assert (draws > 0).all()
    assert prior.log_density(np.array([-0.1, 1.0])) == -np.inf


def test_flat():
    """A flat prior is zero on positive compliances, has no draws, and is not proper."""
    assert Prior.flat(2).log_density(np.array([[1.0, 2.0], [1.0, -2.0]])).tolist() == [0.0, -np.inf]
    assert Prior.flat(2, positive=False).log_density(np.array([1.0, -2.0])) == 0
    assert not Prior.flat(2).proper
    with pytest.raises(ValueError, match="flat prior"):
        Prior.flat(2).draw(np.random.default_rng(0), 3)


def test_gaussian_part_is_exact_for_normal_shapes():
    """Precisions of half-normal and earlier calibration add up to the density's quadratic."""
    prior = Prior((HalfNormal(2.0), Flat()), Normal(np.array([1.0, 2.0]), np.diag([1.0, 4.0])))
    P, h = prior.gaussian()
    k = np.random.default_rng(0).uniform(0.1, 3, (20, 2))
    quadratic = -0.5 * np.einsum("ni,ij,nj->n", k, P, k) + k @ h
    assert np.ptp(prior.log_density(k) - quadratic) < 1e-12
