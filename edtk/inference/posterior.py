"""The posterior of the compliances, sampled with emcee."""

from collections.abc import Callable
from dataclasses import dataclass

import emcee
import numpy as np
from numpy.typing import NDArray

from edtk.inference.estimate import Estimate

Array = NDArray[np.float64]


class UnconvergedError(RuntimeError):
    """The chain did not reach the length that its autocorrelation time asks for."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """Samples of the compliances and how far they can be trusted.

    Attributes:
        samples: Kept samples (steps, walkers, p), burn-in removed [rad/(N m)].
        tau: Integrated autocorrelation time (p,), in steps.
        steps: Length of the whole chain.
    """

    samples: Array
    tau: Array
    steps: int

    @property
    def std(self) -> Array:
        """Posterior standard deviations (p,)."""
        return self.samples.std(axis=(0, 1))

    @property
    def effective(self) -> Array:
        """Effective number of independent samples (p,)."""
        return np.prod(self.samples.shape[:2]) / self.tau

    @property
    def std_error(self) -> Array:
        """Monte-Carlo standard error (p,) of `std`, for a near-normal posterior.

        The variance of the mean of N squared deviations is ``2 std^4 tau/N``, with the autocorrelation time tau of
        the squared deviations themselves, so that the error of std is ``std sqrt(tau / 2N)``.
        """
        squares = (self.samples - self.samples.mean(axis=(0, 1))) ** 2
        tau = emcee.autocorr.integrated_time(squares / squares.mean(axis=(0, 1)), tol=0)
        return self.std * np.sqrt(tau / (2.0 * np.prod(self.samples.shape[:2])))


def sample_posterior(
    A: Array,
    measured: Array,
    sigma: Array,
    fit: Estimate,
    rng: np.random.Generator,
    walkers: int = 32,
    length: int = 400,
    most: int = 60_000,
    progress: Callable[[int], object] = lambda steps: None,
) -> Posterior:
    """Sample ``exp(-sum |A_i k - dp_i|^2 / 2 sigma^2)`` with a flat prior.

    Parameters are ``(k - k_hat) / std`` of the least-squares fit, of order one. The chain runs until it is
    `length` integrated autocorrelation times long and that time is stable to 5 %; the first ten times are dropped.

    Args:
        A: Regressors (m, rows, p).
        measured: Deflections (m, rows) [m, rad].
        sigma: Noise per row (rows,) [m, rad].
        fit: The least-squares estimate, for the scale and the start.
        rng: Source of randomness.
        walkers: Size of emcee's ensemble, even and at least 2 p.
        length: Required length in autocorrelation times.
        most: Limit on the number of steps.
        progress: Called with the number of steps so far.

    Raises:
        UnconvergedError: The limit was reached first.
    """
    std = np.sqrt(np.diag(fit.covariance))
    rows = (A / sigma[:, None]).reshape(-1, len(std)) * std
    residual = (measured / sigma).ravel() - rows @ (fit.k / std)

    def log_posterior(x: Array) -> Array:
        return -0.5 * ((x @ rows.T - residual) ** 2).sum(axis=-1)

    sampler = emcee.EnsembleSampler(walkers, len(std), log_posterior, vectorize=True)
    seed = np.random.RandomState(int(rng.integers(2**31)))
    sampler.random_state = seed.get_state()
    state = emcee.State(rng.standard_normal((walkers, len(std))), random_state=seed.get_state())
    before = np.inf
    while sampler.iteration < most:
        state = sampler.run_mcmc(state, 1000)
        progress(sampler.iteration)
        tau = sampler.get_autocorr_time(tol=0)
        if sampler.iteration > length * tau.max() and np.all(np.abs(before - tau) < 0.05 * tau):
            burn = int(np.ceil(10 * tau.max()))
            return Posterior(fit.k + std * sampler.get_chain(discard=burn), tau, sampler.iteration)
        before = tau
    raise UnconvergedError(f"the chain did not converge in {most} steps; raise the limit")
