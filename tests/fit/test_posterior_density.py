"""The density that is sampled, beside prior times likelihood of every single row."""

import numpy as np
import pytest
from scipy import stats

from edtk.fit.least_squares import estimate
from edtk.fit.noise import Noise
from edtk.fit.posterior import MeasuredRows, PosteriorDensity
from edtk.fit.prior import LogNormal, Normal, Prior

SIGMA = np.array([0.1, 0.2, 0.05])
A = np.random.default_rng(0).normal(size=(5, 3, 2)) * [1.0, 1e3]
K = np.array([1.0, 2e-3])
MEASURED = A @ K + SIGMA * np.random.default_rng(1).standard_normal((5, 3))
FIT = estimate(A, MEASURED, SIGMA, ("a", "b"))
ROWS = MeasuredRows.of(A, MEASURED, SIGMA, FIT.k)
PRIOR = Prior((LogNormal(1.0, 2.0), LogNormal(2e-3, 1.5)))


def density(noise, prior=PRIOR):
    """The density given the measurements above."""
    return PosteriorDensity.of(ROWS, FIT, prior, noise)


@pytest.mark.parametrize("nu", [4.0, np.inf])
def test_density_is_prior_times_likelihood(nu):
    """At any coordinates it is the product over all rows, but for a constant factor."""
    found = density(Noise(nu=nu))
    x = np.random.default_rng(2).normal(size=(20, 2))
    k = found.parameters(x)
    z = (MEASURED - np.einsum("mrp,np->nmr", A, k)) / SIGMA
    exact = stats.t(nu).logpdf(z).sum(axis=(1, 2)) + PRIOR.log_density(k)
    assert np.ptp(found.log_density(x) - exact) < 1e-9


def test_coordinates_are_whitened():
    """With normal noise and a normal prior the density is standard normal in its coordinates."""
    prior = Prior(Prior.flat(2).marginals, Normal(K, np.diag(FIT.covariance) * np.eye(2)), False)
    x = np.random.default_rng(3).normal(size=(20, 2))
    assert np.ptp(density(Noise(), prior).log_density(x) + 0.5 * (x**2).sum(axis=1)) < 1e-9


def test_rows():
    """Fifteen rows of two compliances have thirteen degrees of freedom; fourteen tell of each."""
    assert (ROWS.freedom, ROWS.telling, ROWS.exact) == (13, 14, False)
    assert MeasuredRows.of(A, A @ K, SIGMA, K).exact
