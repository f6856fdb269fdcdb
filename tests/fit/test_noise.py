"""Likelihoods of the noise beside scipy's."""

import numpy as np
import pytest
from scipy import stats

from edtk.fit.noise import Noise

R = np.random.default_rng(0).standard_normal((6, 10))
LOG_S, LOG_NU = np.random.default_rng(1).normal(size=(2, 6))


@pytest.mark.parametrize("nu", [np.inf, 4.0, None])
@pytest.mark.parametrize("factor", [1.0, 2.0, np.inf])
def test_likelihood(nu, factor):
    """The logarithm differs from that of scipy's densities by a constant, whatever is sampled."""
    noise = Noise(factor, nu)
    extra = np.stack(
        [x for x, yes in ((LOG_S, factor > 1), (LOG_NU, nu is None)) if yes] or [LOG_S], axis=-1
    )
    extra = extra[:, : len(noise.names)]
    s = np.exp(LOG_S) if factor > 1 else np.ones(6)
    degrees = np.exp(LOG_NU) if nu is None else np.full(6, nu)
    exact = stats.t(degrees[:, None], scale=s[:, None]).logpdf(R).sum(axis=-1)
    assert np.ptp(noise.log_likelihood(R, extra) - exact) < 1e-10


def test_prior_of_the_logarithms():
    """Jeffreys' prior is flat in log s, a factor is a normal one, and nu is gamma(2, 0.1)."""
    extra = np.stack([LOG_S, LOG_NU], axis=-1)
    nu = stats.gamma(2, scale=10).logpdf(np.exp(LOG_NU)) + LOG_NU
    assert np.ptp(Noise(np.inf, None).log_prior(extra) - nu) < 1e-12
    assert (
        np.ptp(Noise(2.0, None).log_prior(extra) - nu - stats.norm(0, np.log(2)).logpdf(LOG_S))
        < 1e-12
    )
    assert Noise().names == ()


def test_walkers_that_wander_far_have_a_number():
    """At a noise of nothing, or degrees of freedom beyond all numbers, a density is a number."""
    noise = Noise(sigma_factor=np.inf, nu=None)
    extra = np.array([[-1e4, 0.0], [1e4, 1e4], [0.0, -1e4]])
    residuals = np.full((3, 4), 1e6)
    total = noise.log_likelihood(residuals, extra) + noise.log_prior(extra)
    assert not np.isnan(total).any()
    assert (total < 0).all()
