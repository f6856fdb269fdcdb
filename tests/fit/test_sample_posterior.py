"""The sampled posterior of a small linear problem, where it is known in closed form."""

import pickle

import numpy as np
import pytest
from scipy import stats

from edtk.fit.least_squares import estimate
from edtk.fit.measurements import simulate
from edtk.fit.noise import Noise
from edtk.fit.posterior import (
    ImproperPosteriorError,
    SamplingOptions,
    sample_posterior,
)
from edtk.fit.prior import HalfNormal, LogNormal, Normal, Prior
from edtk.fit.run_chain import Demand

pytestmark = pytest.mark.slow

SIGMA = np.array([0.1, 0.2, 0.05])
A = np.random.default_rng(0).normal(size=(4, 3, 2))
MEASURED = simulate(A, [1.0, 2.0], SIGMA, np.random.default_rng(1))[0]
FIT = estimate(A, MEASURED, SIGMA, ("a", "b"))
ROUGH = Demand(accuracy=0.03)


def sample(seed, demand=ROUGH, prior=None, **kept):
    """Posterior of two compliances; `kept` are the chain's file and progress."""
    rng = np.random.default_rng(seed)
    options = SamplingOptions(demand, **kept)
    return sample_posterior(A, MEASURED, SIGMA, FIT, rng, prior=prior, options=options)


def one(measured, sigma, **known):
    """Posterior of one compliance, measured directly m times; `known` are prior and noise."""
    B = np.ones((len(measured), 1, 1))
    y = np.reshape(measured, (-1, 1)).astype(float)
    size = np.array([sigma])
    fit = estimate(B, y, size, ("a",))
    options = SamplingOptions(ROUGH)
    return sample_posterior(B, y, size, fit, np.random.default_rng(0), options=options, **known)


def distance(posterior, cdf):
    """Kolmogorov's distance of samples of one compliance from a law, over its expected size."""
    samples = np.sort(posterior.samples.ravel())
    empirical = (np.arange(len(samples)) + 0.5) / len(samples)
    return np.abs(cdf(samples) - empirical).max() * np.sqrt(posterior.effective[0])


@pytest.fixture(scope="module")
def chains():
    return [sample(seed) for seed in range(8)]


def test_covariance_and_mean(chains):
    """A flat prior's posterior is normal about the least-squares estimate with Eq. (13).

    Eight chains are averaged; means and correlations are held to 4.5 of their standard errors.
    """
    effective = sum(c.effective.min() for c in chains)
    pooled = np.concatenate([c.samples.reshape(-1, 2) for c in chains])
    assert np.abs((pooled.mean(axis=0) - FIT.k) / FIT.std).max() * np.sqrt(effective) < 4.5
    expected = FIT.covariance / np.outer(FIT.std, FIT.std)
    excess = np.cov((pooled - FIT.k).T / FIT.std[:, None]) - expected
    assert np.abs(excess).max() * np.sqrt(effective / 2) < 4.5


def test_standard_error_is_honest(chains):
    """Errors of `std`, in units of the stated one, are as large as chance has them.

    Their squares add up to a chi-square of 16, held at 0.1 %.
    """
    z = np.array([(c.std - FIT.std) / c.std_error for c in chains])
    assert 3.94 < (z**2).sum() < 39.3


def test_intervals(chains):
    """Ends of the central 95 % intervals are the normal law's, within five standard errors."""
    for c in chains:
        error = np.sqrt(0.025 * 0.975 / c.effective.min()) / stats.norm.pdf(1.96)
        expected = FIT.k + np.outer([-1.96, 1.96], FIT.std)
        assert np.abs((c.interval() - expected) / FIT.std).max() < 5 * error


def test_unknown_sigma():
    """With sigma unknown a compliance is Student-t, with the residuals' own spread.

    The further parameter is the root of a scaled inverse chi-square.
    """
    y = np.array([4.9, 5.2, 5.0, 5.4, 4.7, 5.3])
    found = one(y, 0.01, noise=Noise(np.inf))
    exact = stats.t(5, loc=y.mean(), scale=y.std(ddof=1) / np.sqrt(6))
    assert distance(found, exact.cdf) < 2
    s = np.sort(found.noise[..., 0].ravel())
    squares = ((y - y.mean()) ** 2).sum() / 0.01**2
    off = stats.chi2.sf(squares / s**2, 5) - (np.arange(len(s)) + 0.5) / len(s)
    assert np.abs(off).max() * np.sqrt(found.effective[0]) < 2
    assert found.noise_names == ("sigma_ratio",)


def test_truncation_at_zero():
    """Where the estimate is negative the posterior is the normal one cut off at zero.

    Without positivity it is not cut off.
    """
    found = one([-0.5], 1.0)
    assert (found.samples > 0).all()
    assert distance(found, stats.truncnorm(0.5, np.inf, loc=-0.5).cdf) < 2
    free = one([-0.5], 1.0, prior=Prior.flat(1, positive=False))
    assert distance(free, stats.norm(-0.5).cdf) < 2


@pytest.mark.parametrize("nu", [3.0, np.inf])
@pytest.mark.parametrize("marginal", [HalfNormal(0.8), LogNormal(1.2, 1.5)])
def test_priors_of_one_compliance(marginal, nu):
    """Posteriors under both kinds of priors and of noise are those of quadrature."""
    found = one([0.7, 1.3, 0.2], 0.6, prior=Prior((marginal,)), noise=Noise(nu=nu))
    k = np.linspace(1e-4, 6, 60_001)
    likelihood = stats.t(nu, loc=[[0.7], [1.3], [0.2]], scale=0.6).pdf(k).prod(axis=0)
    prior = {
        HalfNormal: stats.halfnorm(scale=0.8),
        LogNormal: stats.lognorm(np.log(1.5), scale=1.2),
    }[type(marginal)]
    cdf = np.cumsum(likelihood * prior.pdf(k))
    assert distance(found, lambda x: np.interp(x, k, cdf / cdf[-1])) < 2


def test_earlier_calibration():
    """A normal prior far above zero is conjugate: precisions add up."""
    covariance = np.array([[2.0, 0.5], [0.5, 1.0]]) * np.outer(FIT.std, FIT.std)
    earlier = Normal(FIT.k + FIT.std, covariance)
    precision = np.linalg.inv(FIT.covariance) + np.linalg.inv(covariance)
    weighted = np.linalg.solve(FIT.covariance, FIT.k) + np.linalg.solve(covariance, earlier.mean)
    mean = np.linalg.solve(precision, weighted)
    found = sample(0, prior=Prior(Prior.flat(2).marginals, earlier))
    std = np.sqrt(np.linalg.inv(precision).diagonal())
    assert np.abs((found.mean - mean) / std * np.sqrt(found.effective)).max() < 4.5
    assert np.abs((found.std - std) / found.std_error).max() < 4.5


def test_unknown_degrees_of_freedom():
    """An outlier makes sampled degrees of freedom small, and does not move the compliance."""
    y = [1.0, 1.1, 0.9, 1.05, 0.95, 1.02, 3.0]
    found = one(y, 0.1, noise=Noise(nu=None))
    assert found.noise_names == ("nu",)
    assert np.median(found.noise[..., 0]) < 5
    assert abs(np.median(found.samples) - 1.0) < 0.1 < np.mean(y) - 1.0


def test_seed(chains):
    """The same seed gives the same chain, another seed another."""
    again = sample(0)
    np.testing.assert_array_equal(again.samples, chains[0].samples)
    np.testing.assert_array_equal(again.tau, chains[0].tau)
    assert (chains[1].samples[:5] != chains[0].samples[:5]).any()


def test_chain_is_as_long_as_asked(chains):
    """A chain has the length and the accuracy asked for, and its burn-in is dropped."""
    for c in chains:
        assert c.steps > 50 * c.tau.max()
        assert (c.std_error / c.std).max() <= ROUGH.accuracy
        assert c.r_hat.max() < 1.01
        assert c.samples.shape == (c.steps - int(np.ceil(10 * c.tau.max())), 32, 2)


def test_names(chains):
    """The samples carry the names of the least-squares fit."""
    assert chains[0].parameters == ("a", "b")


def test_far_behind_the_bound():
    """Where the estimate is forty deviations below zero the posterior is exponential."""
    found = one([-40.0], 1.0)
    assert distance(found, stats.truncnorm(40.0, np.inf, loc=-40.0).cdf) < 2


def refusal(measured, noise):
    """The error that refuses to sample a posterior without variances."""
    with pytest.raises(ImproperPosteriorError) as caught:
        one(measured, 0.1, noise=noise)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    return caught.value


def test_too_few_measurements_for_sigma():
    """With sigma unknown a posterior without standard deviations is refused, with both numbers."""
    error = refusal([1.0, 1.1, 0.9], Noise(np.inf))
    assert "by 3, and do by 2" in str(error)


def test_a_prior_gives_standard_deviations():
    """A prior with standard deviations makes up for measurements."""
    known = Prior((LogNormal(1.0, 1.2),))
    assert one([1.0, 1.1, 0.9], 0.1, prior=known, noise=Noise(np.inf)).std < 0.3


@pytest.mark.parametrize(
    "noise", [Noise(nu=1.0), Noise(nu=None), Noise(np.inf, 5.0), Noise(np.inf)]
)
def test_no_variance_no_answer(noise):
    """Too few measurements for what is unknown of the noise are refused, and not sampled."""
    assert "measured rows" in str(refusal([1.0], noise))


def test_exact_measurements_tell_nothing_of_sigma():
    """Readings that the model fits exactly are refused where sigma is unknown."""
    error = refusal([5.0] * 6, Noise(np.inf))
    assert "exactly" in str(error)


def test_a_compliance_of_which_one_measurement_tells():
    """With heavy tails a compliance that one of many measurements tells of has no variance."""
    B = np.zeros((20, 1, 2))
    B[..., 0] = 1.0
    B[7, 0, 1] = 1.0
    measured = np.ones((20, 1))
    sigma = np.full(1, 0.1)
    fit = estimate(B, measured, sigma, ("a", "b"))
    words = "with Student-t errors 1 measured rows that tell of a compliance"
    with pytest.raises(ImproperPosteriorError, match=words):
        sample_posterior(B, measured, sigma, fit, np.random.default_rng(0), noise=Noise(nu=2.0))


def test_a_prior_that_is_far_beyond_all_reason():
    """Where prior and measurements leave no density that a number can hold, nothing is sampled."""
    earlier = Normal(np.array([1.0, 1e50]), np.diag([1e-12, 1e-12]))
    prior = Prior((HalfNormal(1e-5), HalfNormal(1e-5)), earlier)
    with pytest.raises(ImproperPosteriorError, match="correct the prior"):
        sample(0, prior=prior)
