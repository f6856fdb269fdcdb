"""The posterior of the compliances, sampled with emcee."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from edtk.inference.chain_file import ChainFile
from edtk.inference.convergence import std_error
from edtk.inference.draw_positive import draw_positive
from edtk.inference.least_squares import Estimate
from edtk.inference.mcmc import Demand, UnconvergedError, run_chain
from edtk.inference.noise import Noise
from edtk.inference.prior import Prior, flat

__all__ = ["ImproperPosteriorError", "Posterior", "UnconvergedError", "sample_posterior"]

Array = NDArray[np.float64]


class ImproperPosteriorError(ValueError):
    """There are too few measurements for what is unknown: the posterior has no standard deviations."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """Samples of the compliances and how far they can be trusted.

    Attributes:
        samples: Kept samples (steps, walkers, p), burn-in removed [rad/(N m)].
        tau: Integrated autocorrelation time (p,), in steps.
        steps: Length of the whole chain.
        r_hat: Split-chain potential scale reductions (p,).
        noise_tau: Integrated autocorrelation times (e,) of what is unknown of the noise, of its logarithms.
        noise: Samples of what is unknown of the noise (steps, walkers, e), by `noise_names`.
        noise_names: "sigma_ratio", "nu", or none of them.
    """

    samples: Array
    tau: Array
    steps: int
    r_hat: Array
    noise_tau: Array
    noise: Array
    noise_names: tuple[str, ...] = ()

    @property
    def mean(self) -> Array:
        """Posterior means (p,)."""
        return self.samples.mean(axis=(0, 1))

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
        """Monte-Carlo standard error (p,) of `std`."""
        return self.std * std_error(self.samples)

    def interval(self, level: float = 0.95) -> Array:
        """Lower and upper ends (2, p) of the central intervals that hold the compliances with probability `level`."""
        return np.quantile(self.samples, [(1 - level) / 2, (1 + level) / 2], axis=(0, 1))


def sample_posterior(
    A: Array,
    measured: Array,
    sigma: Array,
    fit: Estimate,
    rng: np.random.Generator,
    *,
    prior: Prior | None = None,
    noise: Noise | None = None,
    walkers: int = 32,
    demand: Demand | None = None,
    chain: Path | None = None,
    progress: Callable[[int], object] = lambda steps: None,
) -> Posterior:
    """Sample ``prior(k) prod_i p((dp_i - A_i k) / sigma)``, with what is unknown of the noise.

    Coordinates are whitened, ``k = c + L x``, by the least-squares fit and the Gaussian part of the prior; the walkers
    start as independent draws from that Gaussian, positive if they must be, and so need little burn-in.

    Args:
        A: Regressors (m, rows, p).
        measured: Deflections (m, rows) [m, rad].
        sigma: Noise, one per row (rows,) or one per measurement and row (m, rows) [m, rad].
        fit: The least-squares estimate, for scale and start.
        rng: Source of randomness.
        prior: Of the compliances; None for flat on positive compliances.
        noise: None for normal errors of known sigma.
        walkers: Size of emcee's ensemble, even; four for each parameter where that is more.
        demand: When the chain is long enough.
        chain: File in which the chain is kept, and from which it goes on.
        progress: Called with the number of steps so far.

    Raises:
        UnconvergedError: The limit on the number of steps was reached first.
        ImproperPosteriorError: Too few rows were measured for what is unknown of the noise.
        ChainFileError: The file is no chain, or of another problem.
        OSError: The file cannot be written.
    """
    p, N = A.shape[-1], A.shape[0] * A.shape[1]
    prior = flat(p) if prior is None else prior
    noise = Noise() if noise is None else noise
    walkers = max(walkers, 4 * (p + len(noise.names)))
    rows = (A / np.broadcast_to(sigma, measured.shape)[..., None]).reshape(-1, p)
    y = (measured / sigma).ravel()
    squares = float(((y - rows @ fit.k) ** 2).sum())
    telling = min(N - p + 1, int((rows != 0).sum(axis=0).min()))
    _check(prior, noise, N - p, telling, squares <= 1e-22 * float(y @ y))

    scale = np.sqrt(np.diag(fit.covariance))
    inverse = np.linalg.inv(fit.covariance / np.outer(scale, scale)) / noise.spread(squares, N - p)
    P, h = prior.gaussian()
    precision = inverse + P * np.outer(scale, scale)
    centre = scale * np.linalg.solve(precision, inverse @ (fit.k / scale) + h * scale)
    L = scale[:, None] * np.linalg.inv(np.linalg.cholesky(precision)).T
    k = centre + rng.standard_normal((walkers, p)) @ L.T
    if prior.log_density(k).min() == -np.inf:
        k = scale * draw_positive(centre / scale, precision, walkers, rng)
    x = np.linalg.solve(L, (k - centre).T).T
    start = np.concatenate([x, noise.start(squares, N - p, rng, walkers)], axis=1)
    seed = int(rng.integers(2**31))
    B, residual, hidden, rest = rows @ L, y - rows @ centre, 0, 0.0
    if (
        noise.normal and p < N
    ):  # all that N normal rows say is in p of them, and in what those leave of the squares
        Q, B = np.linalg.qr(B)
        total, residual = residual @ residual, residual @ Q
        hidden, rest = N - p, max(float(total - residual @ residual), 0.0)

    def log_density(x: Array) -> Array:
        extra = x[:, p:]
        likelihood = noise.log_likelihood(residual - x[:, :p] @ B.T, extra, hidden, rest)
        total = likelihood + noise.log_prior(extra) + prior.log_density(centre + x[:, :p] @ L.T)
        return np.where(np.isnan(total), -np.inf, total)

    def view(x: Array) -> Array:
        return np.concatenate([centre + x[..., :p] @ L.T, x[..., p:]], axis=-1)

    file = None
    if chain is not None:
        content = [A, measured, sigma, start, np.array([seed]), view(np.eye(p + len(noise.names)))]
        digest = hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in content))
        digest.update(repr((prior, noise)).encode())
        file = ChainFile(chain, digest.hexdigest())
    found = run_chain(log_density, view, start, seed, demand or Demand(), file, progress)
    samples, extra = found.samples[..., :p], np.exp(found.samples[..., p:])
    return Posterior(
        samples, found.tau[:p], found.steps, found.r_hat[:p], found.tau[p:], extra, noise.names
    )


def _check(prior: Prior, noise: Noise, freedom: int, telling: int, exact: bool) -> None:
    """Refuse posteriors without variances.

    Under Jeffreys' prior of sigma the compliances are Student-t with `freedom` degrees of freedom. Under Student-t
    errors the density falls like ``|k|^(-r (nu + 1))`` along a direction of which r rows tell: ``r (nu + 1) - 1``
    degrees of freedom. With two of them or fewer variances are infinite. Of N rows in general position ``N - p + 1``
    tell of every direction, and of a parameter those whose entry is not zero: the least of these is `telling`.
    """
    if noise.sigma_factor == np.inf and freedom <= (0 if prior.proper else 2):
        raise ImproperPosteriorError(
            f"with sigma unknown the measured rows must outnumber the compliances by {1 if prior.proper else 3}, "
            f"and do by {freedom}; measure more, or say how well sigma is known"
        )
    if noise.sigma_factor == np.inf and exact:
        raise ImproperPosteriorError(
            "the model fits the measurements exactly, which leaves nothing to tell sigma from"
        )
    least = 0.0 if noise.nu is None else noise.nu
    if not noise.normal and not prior.proper and telling * (least + 1) - 1 <= 2:
        raise ImproperPosteriorError(
            f"with Student-t errors {telling} measured rows that tell of a compliance, or of several together, are too "
            "few; measure more, or give every compliance a prior"
        )
