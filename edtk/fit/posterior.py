"""Posterior distributions: their densities, their samples, and what these say."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from edtk.fit.correlated_noise import RowNoise, numbers_of, whiten, whiten_columns
from edtk.fit.least_squares import Estimate
from edtk.fit.noise import Noise
from edtk.fit.prior import Prior, draw_positive
from edtk.fit.run_chain import Chain, ChainFile, Demand, Density, run_chain, std_error
from edtk.system.presented import Presented
from edtk.system.time_limit import no_progress
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd

# emcee's differential evolution moves along differences of two other walkers, which must span the
# space; twice the dimension is the least that it accepts.
WALKERS_PER_PARAMETER = 4
# A fit is exact where the squares of its residuals are this share of those of the measurements:
# rounding to 1e-11.
EXACT_FIT = 1e-22
# Degrees of freedom up to which Student's t has no variance.
NO_VARIANCE = 2
EMCEE = "emcee"
LAPLACE = "Laplace"
DRAWS = 2000  # of a normal approximation, that are weighted
TRUSTED = 0.5  # share of these draws that have to be effective


@dataclass(frozen=True, eq=False)
class MeasuredRows:
    """Measurements in units of the noise, a row each.

    Attributes:
        X: Regressors (N, p) over sigma.
        y: Measured (N,) over sigma.
        squares: Sum of the squared residuals of the least-squares fit.
    """

    X: Array
    y: Array
    squares: float

    @classmethod
    def of(cls, A: Array, measured: Array, sigma: RowNoise, k: Array) -> "MeasuredRows":
        """Rows of regressors (m, rows, p), with residuals of the fit k (p,)."""
        X = whiten_columns(A, sigma).reshape(-1, A.shape[-1])
        y = whiten(measured, sigma).ravel()
        return cls(X, y, float(((y - X @ k) ** 2).sum()))

    @property
    def freedom(self) -> int:
        """How many more rows than compliances there are."""
        return self.X.shape[0] - self.X.shape[1]

    @property
    def telling(self) -> int:
        """The least number of rows that tell of any direction of the compliances.

        Of N rows in general position ``N - p + 1`` tell of every direction, and of a parameter
        those whose entry is not zero.
        """
        return min(self.freedom + 1, int((self.X != 0).sum(axis=0).min()))

    @property
    def exact(self) -> bool:
        """Whether the model fits the measurements up to rounding."""
        return self.squares <= EXACT_FIT * float(self.y @ self.y)


@dataclass(frozen=True, eq=False)
class _Coordinates:
    """Coordinates in which the posterior is about standard normal: ``k = centre + L x``.

    They are those of the Gaussian that is the product of the least-squares fit and of the Gaussian
    part of the prior.

    Attributes:
        centre: Its mean (p,) [rad/(N m)].
        L: A root (p, p) of its covariance.
        scale: Standard deviations (p,) of the least-squares fit [rad/(N m)].
        precision: Precision (p, p) of ``k / scale``.
    """

    centre: Array
    L: Array
    scale: Array
    precision: Array

    @classmethod
    def of(cls, fit: Estimate, prior: Prior, spread: float) -> "_Coordinates":
        """Coordinates for a fit whose errors have `spread` times the variance that it states."""
        scale = np.sqrt(np.diag(fit.covariance))
        # Parameters differ by powers of ten: matrices are inverted after scaling to a unit
        # diagonal.
        inverse = np.linalg.inv(fit.covariance / np.outer(scale, scale)) / spread
        P, h = prior.gaussian()
        precision = inverse + P * np.outer(scale, scale)
        centre = scale * np.linalg.solve(precision, inverse @ (fit.k / scale) + h * scale)
        L = scale[:, None] * np.linalg.inv(np.linalg.cholesky(precision)).T
        return cls(centre, L, scale, precision)

    def compliances(self, x: Array) -> Array:
        """Compliances (..., p) [rad/(N m)] at coordinates (..., p)."""
        return self.centre + x @ self.L.T


@dataclass(frozen=True, eq=False)
class PosteriorDensity:
    """The density that is sampled: coordinates (p,), then what is unknown of the noise (e,).

    Residuals in units of the noise are ``residual - B x``, and `hidden` more that do not depend on
    x, with the sum of squares `rest`.
    """

    coordinates: _Coordinates
    prior: Prior
    noise: Noise
    B: Array
    residual: Array
    hidden: int = 0
    rest: float = 0.0

    @classmethod
    def of(
        cls, data: MeasuredRows, fit: Estimate, prior: Prior, noise: Noise
    ) -> "PosteriorDensity":
        """The density given measurements and their least-squares fit."""
        spread = noise.spread(data.squares, data.freedom)
        coordinates = _Coordinates.of(fit, prior, spread)
        B = data.X @ coordinates.L
        residual = data.y - data.X @ coordinates.centre
        if not noise.normal or data.freedom <= 0:
            return cls(coordinates, prior, noise, B, residual)
        # N normal rows say no more than p rotated ones, and the sum of squares that they leave:
        # so the cost of a step does not grow with the number of measurements.
        Q, R = np.linalg.qr(B)
        total = residual @ residual
        rotated = residual @ Q
        rest = max(float(total - rotated @ rotated), 0.0)
        return cls(coordinates, prior, noise, R, rotated, data.freedom, rest)

    def log_density(self, x: Array) -> Array:
        """Logarithm (n,) up to a constant, at coordinates (n, p + e)."""
        p = len(self.coordinates.centre)
        extra = x[:, p:]
        residuals = self.residual - x[:, :p] @ self.B.T
        likelihood = self.noise.log_likelihood(residuals, extra, self.hidden, self.rest)
        compliances = self.coordinates.compliances(x[:, :p])
        total = likelihood + self.noise.log_prior(extra) + self.prior.log_density(compliances)
        # Walkers that are thrown far out overflow; emcee wants a number to reject.
        return np.where(np.isnan(total), -np.inf, total)

    def parameters(self, x: Array) -> Array:
        """Compliances, then logarithms of what is unknown of the noise, (..., p + e)."""
        p = len(self.coordinates.centre)
        return np.concatenate([self.coordinates.compliances(x[..., :p]), x[..., p:]], axis=-1)

    def start(self, data: MeasuredRows, rng: np.random.Generator, walkers: int) -> Array:
        """Where the walkers start (walkers, p + e): independent draws, which need little burn-in.

        The compliances are drawn from the Gaussian of the coordinates, confined to positive numbers
        if the prior asks for it.
        """
        at = self.coordinates
        p = len(at.centre)
        walkers = max(walkers, WALKERS_PER_PARAMETER * (p + len(self.noise.names)))
        k = at.compliances(rng.standard_normal((walkers, p)))
        if self.prior.log_density(k).min() == -np.inf:
            # Rejection would never end where the estimate is far below zero.
            k = at.scale * draw_positive(at.centre / at.scale, at.precision, walkers, rng)
        x = np.linalg.solve(at.L, (k - at.centre).T).T
        extra = self.noise.start(data.squares, data.freedom, rng, walkers)
        return np.concatenate([x, extra], axis=1)

    @property
    def content(self) -> tuple[list[Array], str]:
        """What tells the density from others: numbers, and words."""
        numbers = self.parameters(np.eye(len(self.coordinates.centre) + len(self.noise.names)))
        return [numbers], repr((self.prior, self.noise))


@dataclass(frozen=True, eq=False)
class Posterior(Presented):
    """A posterior, as draws: a chain's, or weighted ones of a normal approximation.

    Attributes:
        samples: Kept samples (steps, walkers, p), burn-in removed, in the parameters' units.
        tau: Draws (p,) that tell as much as one independent one: of a chain the integrated
            autocorrelation times, in steps.
        steps: Length of the whole chain, or number of draws.
        r_hat: Split-chain potential scale reductions (p,); one of independent draws.
        noise_tau: Integrated autocorrelation times (e,) of the logarithms of what is unknown of the
            noise, in steps.
        noise: Samples of what is unknown of the noise (steps, walkers, e), by `noise_names`.
        noise_names: "sigma_ratio", "nu", both or neither.
        parameters: Names (p,) of the parameters; empty where nobody gave names.
        units: Their units (p,); empty likewise.
        weights: Weights (steps, walkers) of the draws, of sum one: the density over that of the
            normal approximation, so that all that is said is of the density. None where all are
            equal, as a chain's.
    """

    samples: Array
    tau: Array
    steps: int
    r_hat: Array
    noise_tau: Array
    noise: Array
    noise_names: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    weights: Array | None = None

    def headline(self) -> str:
        """How many parameters, and how far what is said of them can be trusted."""
        return f"{self.samples.shape[-1]} parameters, {self.quality}"

    @property
    def method(self) -> str:
        """How it was computed: "emcee", or "Laplace" with weighted draws."""
        return EMCEE if self.weights is None else LAPLACE

    @property
    def draws(self) -> int:
        """How many draws there are."""
        return int(np.prod(self.samples.shape[:2]))

    @property
    def effective_share(self) -> float:
        """Which part of the draws counts, were they independent; of the worst parameter."""
        return float(1 / self.tau.max())

    @property
    def trusted(self) -> bool:
        """Whether the draws tell of the density; a chain that has not converged is none."""
        return self.weights is None or self.effective_share >= TRUSTED

    @property
    def quality(self) -> str:
        """How it was computed, and the check, in words."""
        if self.weights is None:
            return (
                f"sampled by emcee: {self.steps} steps of {self.samples.shape[1]} walkers, at "
                f"least {self.effective.min():.0f} effective samples, R-hat up to "
                f"{self.r_hat.max():.4f}"
            )
        text = (
            f"Laplace's approximation, checked by {self.steps} draws weighted with the nonlinear "
            f"density: {100 * self.effective_share:.0f} % are effective"
        )
        if self.trusted:
            return text
        return f"{text}, too few to trust it; a chain (--chain) takes longer, and needs none"

    @cached_property
    def mean(self) -> Array:
        """Posterior means (p,)."""
        return self._average(self.samples)

    @cached_property
    def std(self) -> Array:
        """Posterior standard deviations (p,)."""
        if self.weights is None:
            return self.samples.std(axis=(0, 1))
        return np.sqrt(self._average((self.samples - self.mean) ** 2))

    @property
    def covariance(self) -> Array:
        """Posterior covariance (p, p)."""
        flat = self.samples.reshape(-1, self.samples.shape[-1])
        weights = None if self.weights is None else self.weights.ravel()
        return np.atleast_2d(np.cov(flat.T, ddof=0, aweights=weights))

    @property
    def effective(self) -> Array:
        """Effective number of independent samples (p,)."""
        return self.draws / self.tau

    @property
    def std_error(self) -> Array:
        """Monte-Carlo standard error (p,) of `std`.

        Of independent weighted draws it is ``sqrt(sum w^2 (y^2 - std^2)^2) / (2 std)``, with the
        deviations y.
        """
        if self.weights is None:
            return self.std * std_error(self.samples)
        off = (self.samples - self.mean) ** 2 - self.std**2
        errors = np.einsum("sw,swp->p", self.weights**2, off**2)
        return np.asarray(np.sqrt(errors) / (2 * self.std))

    def interval(self, level: float = 0.95) -> Array:
        """Ends (2, p) of the central intervals that hold the parameters with that probability."""
        ends = [(1 - level) / 2, (1 + level) / 2]
        if self.weights is None:
            return np.quantile(self.samples, ends, axis=(0, 1))
        result = np.empty((2, self.samples.shape[-1]))
        for i, values in enumerate(self.samples.reshape(self.draws, -1).T):
            order = np.argsort(values)
            weights = self.weights.ravel()[order]
            result[:, i] = np.interp(ends, np.cumsum(weights) - 0.5 * weights, values[order])
        return result

    def evenly(self) -> "Posterior":
        """The same with equal weights: each draw as often as it weighs (Kitagawa 1996).

        For pictures, which show a draw as one point; numbers are better by the weights.
        """
        if self.weights is None:
            return self
        places = (np.arange(self.draws) + 0.5) / self.draws
        sums = np.cumsum(self.weights)
        chosen = np.searchsorted(sums / sums[-1], places)
        samples = self.samples.reshape(self.draws, -1)[chosen].reshape(self.samples.shape)
        return replace(self, samples=samples, weights=None)

    def _average(self, values: Array) -> Array:
        """Weighted mean (...) of values (steps, walkers, ...)."""
        if self.weights is None:
            return np.asarray(values.mean(axis=(0, 1)))
        return np.tensordot(self.weights, values, 2)

    def to_frame(self) -> "pd.DataFrame":
        """One row a parameter, in its unit.

        Columns: `parameter`, `unit` where units are known, `mean`, `std`, `low_95`, `high_95`,
        `std_error`, `tau_steps`, `r_hat` and `effective_samples`.
        """
        import pandas as pd

        low, high = self.interval()
        numbered = tuple(str(i + 1) for i in range(self.samples.shape[-1]))
        columns: dict[str, Any] = {"parameter": self.parameters or numbered}
        if self.units:
            columns["unit"] = self.units
        columns |= {
            "mean": self.mean,
            "std": self.std,
            "low_95": low,
            "high_95": high,
            "std_error": self.std_error,
            "tau_steps": self.tau,
            "r_hat": self.r_hat,
            "effective_samples": self.effective,
        }
        return pd.DataFrame(columns)


class ImproperPosteriorError(ValueError):
    """The posterior has no standard deviations: too little was measured for what is unknown."""


@dataclass(frozen=True)
class SamplingOptions:
    """How a posterior is sampled; the defaults suit a calibration.

    Attributes:
        demand: When the chain is long enough.
        chain: File in which the chain is kept, and from which it is resumed; or None.
        progress: Called with the number of steps so far.
        walkers: Size of emcee's ensemble, even; four a parameter where that is more.
    """

    demand: Demand = field(default_factory=Demand)
    chain: Path | None = None
    progress: Callable[[int], object] = no_progress
    walkers: int = 32


NORMAL = Noise()
DEFAULT_OPTIONS = SamplingOptions()


class Recognised(Density, Protocol):
    """A density that tells itself from others, so that a chain of it can be kept."""

    @property
    def content(self) -> tuple[list[Array], str]:
        """Numbers, and words, on which it depends."""


def sample_chain(
    density: Recognised,
    start: Array,
    seed: int,
    options: SamplingOptions,
    data: Sequence[Array] = (),
) -> Chain:
    """Sample any density; the chain is kept, and taken up, where the options name a file.

    Args:
        density: What is sampled.
        start: Coordinates of the walkers (walkers, d).
        seed: Of the random numbers.
        options: How accurately, and where the chain is kept.
        data: What the density was made of, which a kept chain has to share.

    Raises:
        UnconvergedError: The limit on the number of steps was reached first.
        ChainFileError: The file is no chain, or of another problem.
        OSError: The file cannot be written.
    """
    numbers, words = density.content
    content = [*data, start, np.array([seed]), *numbers]
    file = None if options.chain is None else ChainFile.of(options.chain, content, words)
    return run_chain(density, start, seed, options.demand, file=file, progress=options.progress)


def posterior_of(
    chain: Chain,
    parameters: tuple[str, ...],
    units: tuple[str, ...] = (),
    noise_names: tuple[str, ...] = (),
) -> Posterior:
    """Samples of the parameters, and of what is unknown of the noise without its logarithm.

    Args:
        chain: A chain of the parameters, then the logarithms of the noise's unknowns.
        parameters: Names of the parameters; empty where there are none.
        units: Their units; empty likewise.
        noise_names: What is unknown of the noise.
    """
    p = chain.samples.shape[-1] - len(noise_names)
    return Posterior(
        samples=chain.samples[..., :p],
        tau=chain.tau[:p],
        steps=chain.steps,
        r_hat=chain.r_hat[:p],
        noise_tau=chain.tau[p:],
        noise=np.exp(chain.samples[..., p:]),
        noise_names=noise_names,
        parameters=parameters,
        units=units,
    )


def weighted_draws(
    density: Density,
    rng: np.random.Generator,
    parameters: tuple[str, ...],
    units: tuple[str, ...],
) -> Posterior:
    """Draws of the standard normal distribution, with the weights ``density / normal``.

    Were the density's coordinates far from normal, few draws would have most of the weight: their
    effective number ``1 / sum w^2`` (Kong 1992) is the check.

    Args:
        density: What is approximated, in coordinates in which it is about standard normal.
        rng: Source of randomness.
        parameters: Names (p,) of the parameters.
        units: Their units (p,).
    """
    p = len(parameters)
    x = rng.standard_normal((DRAWS, p))
    log_weights = density.log_density(x) + 0.5 * (x**2).sum(axis=1)
    weights = np.exp(log_weights - log_weights.max())
    weights = weights / weights.sum()
    return Posterior(
        samples=density.parameters(x)[:, None],
        tau=np.full(p, DRAWS * (weights**2).sum()),
        steps=DRAWS,
        r_hat=np.ones(p),
        noise_tau=np.empty(0),
        noise=np.empty((DRAWS, 1, 0)),
        parameters=parameters,
        units=units,
        weights=weights[:, None],
    )


def sample_posterior(
    A: Array,
    measured: Array,
    sigma: RowNoise,
    fit: Estimate,
    rng: np.random.Generator,
    *,
    prior: Prior | None = None,
    noise: Noise = NORMAL,
    options: SamplingOptions = DEFAULT_OPTIONS,
) -> Posterior:
    """Sample ``prior(k) prod_i p((dp_i - A_i k) / sigma)``, with what is unknown of the noise.

    Args:
        A: Regressors (m, rows, p) [m/(rad/(N m))].
        measured: Deflections (m, rows) [m, rad].
        sigma: Noise, one a row (rows,) or one a measurement and row (m, rows) [m, rad]; or
            correlated noise, whose whitened rows are then the ones with normal or Student-t errors.
        fit: The least-squares estimate, for scale, start and names.
        rng: Source of randomness.
        prior: Of the compliances; None for flat on positive compliances.
        noise: What is known of the noise.
        options: How accurately, and where the chain is kept.

    Raises:
        UnconvergedError: The limit on the number of steps was reached first.
        ImproperPosteriorError: Too few rows were measured for what is unknown of the noise.
        ChainFileError: The file is no chain, or of another problem.
        OSError: The file cannot be written.
    """
    prior = Prior.flat(A.shape[-1]) if prior is None else prior
    data = MeasuredRows.of(A, measured, sigma, fit.k)
    _require_variances(prior, noise, data)
    density = PosteriorDensity.of(data, fit, prior, noise)
    start = density.start(data, rng, options.walkers)
    if not np.isfinite(density.log_density(start)).all():
        raise ImproperPosteriorError(
            "the prior and the measurements are so far apart that no compliance has a density "
            "which a number can hold; correct the prior"
        )
    seed = int(rng.integers(2**31))
    chain = sample_chain(density, start, seed, options, [A, measured, *numbers_of(sigma)])
    return posterior_of(chain, fit.parameters, noise_names=noise.names)


def _require_variances(prior: Prior, noise: Noise, data: MeasuredRows) -> None:
    """Refuse posteriors without variances, which would be sampled for ever.

    Under Jeffreys' prior of sigma the compliances are Student-t with ``N - p`` degrees of freedom.
    Under Student-t errors the density falls like ``|k|^(-r (nu + 1))`` along a direction of which r
    rows tell: ``r (nu + 1) - 1`` degrees of freedom. With two of them or fewer variances are
    infinite.

    Raises:
        ImproperPosteriorError: The posterior has no variances.
    """
    sigma_unknown = noise.sigma_factor == np.inf
    needed = 1 if prior.proper else NO_VARIANCE + 1
    if sigma_unknown and data.freedom < needed:
        raise ImproperPosteriorError(
            f"with sigma unknown the measured rows must outnumber the compliances by {needed}, and "
            f"do by {data.freedom}; measure more, or say how well sigma is known"
        )
    if sigma_unknown and data.exact:
        raise ImproperPosteriorError(
            "the model fits the measurements exactly, which leaves nothing to tell sigma from"
        )
    if noise.normal or prior.proper:
        return
    least_nu = 0.0 if noise.nu is None else noise.nu
    if data.telling * (least_nu + 1) - 1 <= NO_VARIANCE:
        raise ImproperPosteriorError(
            f"with Student-t errors {data.telling} measured rows that tell of a compliance, or of "
            "several together, are too few; measure more, or give every compliance a prior"
        )
