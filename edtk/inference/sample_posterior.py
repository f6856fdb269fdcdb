"""The posterior distribution of the compliances, sampled with emcee."""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

import numpy as np

from edtk.inference.least_squares import Estimate
from edtk.inference.noise import Noise
from edtk.inference.posterior import Posterior
from edtk.inference.posterior_density import MeasuredRows, PosteriorDensity
from edtk.inference.prior import Prior
from edtk.inference.run_chain import Chain, Demand, no_progress, run_chain
from edtk.inference.whiten import RowNoise, numbers_of
from edtk.system.typing import Array

# Degrees of freedom up to which Student's t has no variance.
NO_VARIANCE = 2


class ImproperPosterior(Enum):
    """Why a posterior has no standard deviations, or cannot be sampled."""

    SIGMA_FROM_FEW_ROWS = (
        "with sigma unknown the measured rows must outnumber the compliances by {needed}, "
        "and do by {rows}; measure more, or say how well sigma is known"
    )
    SIGMA_FROM_EXACT_FIT = (
        "the model fits the measurements exactly, which leaves nothing to tell sigma from"
    )
    HEAVY_TAILS_FROM_FEW_ROWS = (
        "with Student-t errors {rows} measured rows that tell of a compliance, or of several "
        "together, are too few; measure more, or give every compliance a prior"
    )
    NO_DENSITY = (
        "the prior and the measurements are so far apart that no compliance has a density which a "
        "number can hold; correct the prior"
    )


class ImproperPosteriorError(ValueError):
    """The posterior has no standard deviations: too little was measured for what is unknown.

    Attributes:
        reason: Why.
        rows: Number of rows that there are, as the reason counts them.
        needed: Number of rows that there must be; 0 where no number would do.
    """

    def __init__(self, reason: ImproperPosterior, rows: int = 0, needed: int = 0) -> None:
        super().__init__(reason, rows, needed)
        self.reason = reason
        self.rows = rows
        self.needed = needed

    def __str__(self) -> str:
        return self.reason.value.format(rows=self.rows, needed=self.needed)


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
        raise ImproperPosteriorError(ImproperPosterior.NO_DENSITY)
    seed = int(rng.integers(2**31))
    content = [A, measured, *numbers_of(sigma), start, np.array([seed])]
    file = density.file(options.chain, content)
    chain = run_chain(density, start, seed, options.demand, file=file, progress=options.progress)
    return _posterior(chain, fit.parameters, noise)


def _posterior(chain: Chain, parameters: tuple[str, ...], noise: Noise) -> Posterior:
    """Samples of the compliances, and of what is unknown of the noise without its logarithm."""
    p = chain.samples.shape[-1] - len(noise.names)
    return Posterior(
        samples=chain.samples[..., :p],
        tau=chain.tau[:p],
        steps=chain.steps,
        r_hat=chain.r_hat[:p],
        noise_tau=chain.tau[p:],
        noise=np.exp(chain.samples[..., p:]),
        noise_names=noise.names,
        parameters=parameters,
    )


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
        reason = ImproperPosterior.SIGMA_FROM_FEW_ROWS
        raise ImproperPosteriorError(reason, data.freedom, needed)
    if sigma_unknown and data.exact:
        raise ImproperPosteriorError(ImproperPosterior.SIGMA_FROM_EXACT_FIT)
    if noise.normal or prior.proper:
        return
    least_nu = 0.0 if noise.nu is None else noise.nu
    if data.telling * (least_nu + 1) - 1 <= NO_VARIANCE:
        reason = ImproperPosterior.HEAVY_TAILS_FROM_FEW_ROWS
        raise ImproperPosteriorError(reason, data.telling)
