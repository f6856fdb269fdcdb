"""The sampled posterior of a small linear problem, where it is known in closed form."""

import numpy as np
import pytest
from scipy import stats

from edtk.inference.least_squares import estimate
from edtk.inference.noise import Noise
from edtk.inference.posterior import Posterior
from edtk.inference.prior import HalfNormal, LogNormal, Normal, Prior
from edtk.inference.run_chain import Demand, UnconvergedError
from edtk.inference.sample_posterior import (
    ImproperPosteriorError,
    SamplingOptions,
    sample_posterior,
)
from edtk.inference.simulate import simulate

SIGMA = np.array([0.1, 0.2, 0.05])
A = np.random.default_rng(0).normal(size=(4, 3, 2))
MEASURED = simulate(A, [1.0, 2.0], SIGMA, np.random.default_rng(1))[0]
FIT = estimate(A, MEASURED, SIGMA, ("a", "b"))
STD = np.sqrt(FIT.covariance.diagonal())
ROUGH = Demand(accuracy=0.02)


def sample(seed, demand=ROUGH, prior=None, **kept):
    """Posterior of two compliances; `kept` are the chain's file and progress."""
    rng, options = np.random.default_rng(seed), SamplingOptions(demand, **kept)
    return sample_posterior(A, MEASURED, SIGMA, FIT, rng, prior=prior, options=options)


def one(measured, sigma, **known):
    """Posterior of one compliance, measured directly m times; `known` are prior and noise."""
    B, size = np.ones((len(measured), 1, 1)), np.array([sigma])
    y = np.reshape(measured, (-1, 1)).astype(float)
    fit, rng = estimate(B, y, size, ("a",)), np.random.default_rng(0)
    return sample_posterior(B, y, size, fit, rng, options=SamplingOptions(ROUGH), **known)


def distance(posterior, cdf):
    """Kolmogorov's distance between samples of one compliance and a distribution, over its expected size."""
    samples = np.sort(posterior.samples.ravel())
    empirical = (np.arange(len(samples)) + 0.5) / len(samples)
    return np.abs(cdf(samples) - empirical).max() * np.sqrt(posterior.effective[0])


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
    """Errors of `std`, in units of the reported error, are as large as chance has them: chi-square of 16, at 0.1 %."""
    z = np.array([(c.std - STD) / c.std_error for c in chains])
    assert 3.94 < (z**2).sum() < 39.3


def test_intervals(chains):
    """Ends of the central 95 % intervals are the normal distribution's, within five standard errors of a quantile."""
    for c in chains:
        error = np.sqrt(0.025 * 0.975 / c.effective.min()) / stats.norm.pdf(1.96)
        expected = FIT.k + np.outer([-1.96, 1.96], STD)
        assert np.abs((c.interval() - expected) / STD).max() < 5 * error


def test_unknown_sigma():
    """With sigma unknown a compliance is Student-t about the estimate, with the residuals' own spread.

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
    """Where the estimate is negative the posterior is the normal one cut off at zero; without positivity it is not."""
    found = one([-0.5], 1.0)
    assert (found.samples > 0).all()
    assert distance(found, stats.truncnorm(0.5, np.inf, loc=-0.5).cdf) < 2
    assert distance(one([-0.5], 1.0, prior=Prior.flat(1, positive=False)), stats.norm(-0.5).cdf) < 2


@pytest.mark.parametrize("nu", [3.0, np.inf])
@pytest.mark.parametrize("marginal", [HalfNormal(0.8), LogNormal(1.2, 1.5)])
def test_priors_of_one_compliance(marginal, nu):
    """Posteriors under half-normal and log-normal priors, normal and Student-t noise, are those of quadrature."""
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
    earlier = Normal(FIT.k + STD, np.array([[2.0, 0.5], [0.5, 1.0]]) * np.outer(STD, STD))
    precision = np.linalg.inv(FIT.covariance) + np.linalg.inv(earlier.covariance)
    mean = np.linalg.solve(
        precision,
        np.linalg.solve(FIT.covariance, FIT.k) + np.linalg.solve(earlier.covariance, earlier.mean),
    )
    found = sample(0, prior=Prior(Prior.flat(2).marginals, earlier))
    std = np.sqrt(np.linalg.inv(precision).diagonal())
    assert np.abs((found.mean - mean) / std * np.sqrt(found.effective)).max() < 4.5
    assert np.abs((found.std - std) / found.std_error).max() < 4.5


def test_unknown_degrees_of_freedom():
    """An outlier makes sampled degrees of freedom small, and does not move the compliance as it moves the mean."""
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
    """A chain has the length and the accuracy asked for, and ten autocorrelation times are dropped from its head."""
    for c in chains:
        assert c.steps > 50 * c.tau.max()
        assert (c.std_error / c.std).max() <= ROUGH.accuracy
        assert c.r_hat.max() < 1.01
        assert c.samples.shape == (c.steps - int(np.ceil(10 * c.tau.max())), 32, 2)


@pytest.mark.parametrize("most", [100, 900])
def test_unconverged(most):
    """Too few steps allowed are an error that says so, not a poor answer."""
    with pytest.raises(UnconvergedError, match=f"{most} steps"):
        sample(0, Demand(0.002, most=most))


def test_too_few_measurements():
    """A posterior without standard deviations is refused, unless the prior has them."""
    with pytest.raises(ImproperPosteriorError, match="by 3, and do by 2"):
        one([1.0, 1.1, 0.9], 0.1, noise=Noise(np.inf))
    assert (
        one([1.0, 1.1, 0.9], 0.1, prior=Prior((LogNormal(1.0, 1.2),)), noise=Noise(np.inf)).std
        < 0.3
    )


def test_effective_samples():
    """The effective number is samples over tau; the error of the deviation of white samples is std/sqrt(2N)."""
    samples = np.random.default_rng(0).normal(size=(500, 10, 1))
    posterior = Posterior(samples, np.array([5.0]), 600, np.ones(1), np.empty(0), samples[..., :0])
    assert posterior.effective == pytest.approx(1000)
    assert posterior.std_error == pytest.approx(posterior.std / np.sqrt(2 * 5000), rel=0.1)


def test_far_behind_the_bound():
    """Where the estimate is forty deviations below zero the posterior is the exponential that is left of the normal."""
    found = one([-40.0], 1.0)
    assert distance(found, stats.truncnorm(40.0, np.inf, loc=-40.0).cdf) < 2


@pytest.mark.parametrize(
    "noise", [Noise(nu=1.0), Noise(nu=None), Noise(np.inf, 5.0), Noise(np.inf)]
)
def test_no_variance_no_answer(noise):
    """Too few measurements for what is unknown of the noise are refused, and not sampled for ever."""
    with pytest.raises(ImproperPosteriorError, match="measured rows"):
        one([1.0], 1.0, noise=noise)


def test_exact_measurements_tell_nothing_of_sigma():
    """Readings that the model fits exactly are refused where sigma is unknown."""
    with pytest.raises(ImproperPosteriorError, match="exactly"):
        one([5.0] * 6, 1.0, noise=Noise(np.inf))


def test_a_compliance_of_which_one_measurement_tells():
    """Of many measurements but one tells of a compliance: with heavy tails its variance is infinite, and refused."""
    A = np.zeros((20, 1, 2))
    A[..., 0], A[7, 0, 1] = 1.0, 1.0
    measured, sigma = np.ones((20, 1)), np.full(1, 0.1)
    fit = estimate(A, measured, sigma, ("a", "b"))
    with pytest.raises(
        ImproperPosteriorError,
        match="with Student-t errors 1 measured rows that tell of a compliance",
    ):
        sample_posterior(A, measured, sigma, fit, np.random.default_rng(0), noise=Noise(nu=2.0))
