"""The sampled posterior of a small linear problem, whose covariance is known."""

import numpy as np
import pytest

from edtk.inference import Posterior, estimate, sample_posterior, simulate
from edtk.inference.posterior import UnconvergedError

SIGMA = np.array([0.1, 0.2, 0.05])
A = np.random.default_rng(0).normal(size=(4, 3, 2))
MEASURED = simulate(A, [1.0, 2.0], SIGMA, np.random.default_rng(1))[0]
FIT = estimate(A, MEASURED, SIGMA, ("a", "b"))
STD = np.sqrt(FIT.covariance.diagonal())


def sample(seed, length=100, **options):
    return sample_posterior(A, MEASURED, SIGMA, FIT, np.random.default_rng(seed), length=length, **options)


@pytest.fixture(scope="module")
def chains():
    return [sample(seed) for seed in range(8)]


def test_covariance_and_mean(chains):
    """A flat prior's posterior is normal about the least-squares estimate with Eq. (13)'s covariance.

    Eight chains are averaged; means and correlations are held to 4.5 of their standard errors.
    """
    effective = sum(c.effective.min() for c in chains)
    pooled = np.concatenate([c.samples.reshape(-1, 2) for c in chains])
    assert np.abs((pooled.mean(axis=0) - FIT.k) / STD).max() * np.sqrt(effective) < 4.5
    excess = np.cov((pooled - FIT.k).T / STD[:, None]) - FIT.covariance / np.outer(STD, STD)
    assert np.abs(excess).max() * np.sqrt(effective / 2) < 4.5


def test_standard_error_is_honest(chains):
    """Errors of `std`, in units of the reported error, are no larger than chance allows, nor the report idle.

    Were the reports exact the 16 squares would sum to about chi-square of 16; its 0.1 % point above is 39.3.
    A square decorrelates faster than the value, by a factor of two for an exponential correlation, so that
    reports may be too large: up to threefold, the sum not below a ninth of the 0.1 % point beneath, 3.94/9.
    """
    z = np.array([(c.std - STD) / c.std_error for c in chains])
    assert 3.94 / 9 < (z**2).sum() < 39.3


def test_seed(chains):
    """The same seed gives the same chain, another seed another."""
    again = sample(0)
    np.testing.assert_array_equal(again.samples, chains[0].samples)
    np.testing.assert_array_equal(again.tau, chains[0].tau)
    assert (chains[1].samples[:5] != chains[0].samples[:5]).any()


def test_chain_is_as_long_as_asked(chains):
    """A chain has at least the length asked for, and ten autocorrelation times are dropped from its head."""
    for c in chains:
        assert c.steps > 100 * c.tau.max()
        assert c.samples.shape == (c.steps - int(np.ceil(10 * c.tau.max())), 32, 2)


def test_unconverged():
    """Too few steps allowed are an error that says so, not a poor answer."""
    with pytest.raises(UnconvergedError, match="1000 steps"):
        sample(0, most=1000)


def test_effective_samples():
    """The effective number is samples over tau; the error of the deviation of white samples is std/sqrt(2N)."""
    samples = np.random.default_rng(0).normal(size=(500, 10, 1))
    posterior = Posterior(samples, np.array([5.0]), 600)
    assert posterior.effective == pytest.approx(1000)
    assert posterior.std_error == pytest.approx(posterior.std / np.sqrt(2 * 5000), rel=0.1)
