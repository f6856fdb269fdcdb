"""How the measurements scatter about the model."""

import math
from dataclasses import dataclass

import numpy as np

from edtk.system.typing import Array

# Words for degrees of freedom, as a study and the command line spell them.
NU_IN_WORDS = {"normal": math.inf, "sampled": None}

# Gamma prior of the degrees of freedom of Student's t, of Juarez and Steel (2010): its mean is 20,
# and little of its mass is near normal errors, which nu could not be told from anyway.
NU_SHAPE = 2.0
NU_RATE = 0.1

# Where walkers start: log nu about the logarithm of ten. Within two of these standard deviations
# nu is 3.7 to 27, from heavy tails to nearly normal errors.
NU_START = 10.0
NU_START_WIDTH = 0.5

# s^2 of a fit without residuals: its logarithm must be finite.
LEAST_SPREAD = 1e-12

# Logarithm of the least s that is told from smaller ones: its square is 1e-130.
LEAST_LOG_S = -150.0

# Logarithms of nu beyond this are as improbable as it is.
MOST_LOG_NU = 300.0


@dataclass(frozen=True)
class Noise:
    """Independent errors ``s sigma_row t`` with t standard normal or Student-t.

    What is unknown of the noise is sampled along with the compliances, as logarithms: first log s,
    then log nu.

    Attributes:
        sigma_factor: How well sigma is known: 1 for exactly (s = 1), inf for not at all (Jeffreys'
            prior 1/s), a number f between for log s normal with standard deviation log f.
        nu: Degrees of freedom of Student's t, inf for normal errors; None to sample it,
            gamma(2, 0.1) a priori.
    """

    sigma_factor: float = 1.0
    nu: float | None = math.inf

    @property
    def names(self) -> tuple[str, ...]:
        """Names of what is sampled of the noise, without the logarithm."""
        return ("sigma_ratio",) * (self.sigma_factor > 1) + ("nu",) * (self.nu is None)

    def log_prior(self, extra: Array) -> Array:
        """Logarithm (...) of the prior of the logarithms `extra` (..., e), up to a constant."""
        total = np.zeros(extra.shape[:-1])
        if 1 < self.sigma_factor < math.inf:
            total = total - 0.5 * (extra[..., 0] / math.log(self.sigma_factor)) ** 2
        if self.nu is None:
            # The density of log nu is that of nu, times nu.
            total = total + NU_SHAPE * extra[..., -1] - NU_RATE * _bounded_exp(extra[..., -1])
        return total

    @property
    def normal(self) -> bool:
        """Whether errors are normal, so that the sum of squared residuals says all."""
        return self.nu == math.inf

    def log_likelihood(
        self, residuals: Array, extra: Array, hidden: int = 0, squares: float = 0.0
    ) -> Array:
        """Logarithm (...) of the density of all measurements, up to a constant.

        Args:
            residuals: Measured less modelled, in units of each row's sigma (..., N).
            extra: Logarithms of s and nu, as far as they are sampled (..., e).
            hidden: Number of further residuals, if errors are normal.
            squares: The sum of their squares.
        """
        N = residuals.shape[-1] + hidden
        log_s = extra[..., 0] if self.sigma_factor > 1 else np.zeros(residuals.shape[:-1])
        # A walker that wanders off to a noise of nothing: its density is next to nothing all the
        # same, and the squares of residuals over it are still numbers.
        log_s = np.maximum(log_s, LEAST_LOG_S)
        if self.normal:
            total = np.einsum("...i,...i->...", residuals, residuals) + squares
            return -N * log_s - 0.5 * np.exp(-2 * log_s) * total
        from scipy.special import gammaln

        nu = _bounded_exp(extra[..., -1]) if self.nu is None else np.full(log_s.shape, self.nu)
        norm = gammaln((nu + 1) / 2) - gammaln(nu / 2) - 0.5 * np.log(nu)
        tails = np.log1p(residuals**2 * (np.exp(-2 * log_s) / nu)[..., None]).sum(axis=-1)
        return N * (norm - log_s) - 0.5 * (nu + 1) * tails

    def start(self, squares: float, freedom: int, rng: np.random.Generator, n: int) -> Array:
        """Draw where n walkers start (n, e): log s about the residuals' size, log nu about ten.

        Args:
            squares: Sum of the squared residuals of the least-squares fit, in units of sigma.
            freedom: Number of measured rows less that of the compliances.
            rng: Source of randomness.
            n: Number of walkers.
        """
        centres: list[float] = []
        widths: list[float] = []
        if self.sigma_factor > 1:
            centres.append(0.5 * math.log(self.spread(squares, freedom)))
            # Standard deviation of log s given so many squares, or of its prior where that is less.
            widths.append(min(1 / math.sqrt(2 * max(freedom, 1)), math.log(self.sigma_factor)))
        if self.nu is None:
            centres.append(math.log(NU_START))
            widths.append(NU_START_WIDTH)
        return np.array(centres) + np.array(widths) * rng.standard_normal((n, len(centres)))

    def spread(self, squares: float, freedom: int) -> float:
        """A first guess of s^2, from the sum of squared residuals in units of sigma."""
        if self.sigma_factor < math.inf:
            return 1.0
        return max(squares / max(freedom, 1), LEAST_SPREAD)


def _bounded_exp(log_nu: Array) -> Array:
    """Degrees of freedom (...) of walkers that may wander far, still as numbers."""
    return np.asarray(np.exp(np.clip(log_nu, -MOST_LOG_NU, MOST_LOG_NU)))
