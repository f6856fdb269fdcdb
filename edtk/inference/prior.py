"""Prior knowledge of the compliances, before the measurements."""

from dataclasses import dataclass, field

import numpy as np

from edtk.system.typing import Array

# Draws from an earlier calibration that are not positive are thrown away and drawn again. After so
# many rounds nearly all of its mass is where no compliance can be, which is worth an error.
MOST_ROUNDS = 1000


@dataclass(frozen=True)
class Flat:
    """Nothing is known of a compliance: density 1."""

    def log_density(self, k: Array) -> Array:
        """Logarithm (...) of the density for k (...): zero."""
        return np.zeros_like(k)

    def gaussian(self) -> tuple[float, float]:
        """Mean and precision of a Gaussian near it: no precision at all."""
        return 0.0, 0.0

    def draw(self, rng: np.random.Generator, n: int) -> Array:
        """Nothing can be drawn.

        Raises:
            ValueError: Always: the density has no finite mass.
        """
        raise ValueError("nothing can be drawn from a flat prior")


@dataclass(frozen=True)
class HalfNormal:
    """A compliance is hardly larger than a scale: density ``exp(-k^2 / 2 scale^2)`` for k > 0.

    Attributes:
        scale: Standard deviation of the normal distribution that is cut in half [rad/(N m)].
    """

    scale: float

    def log_density(self, k: Array) -> Array:
        """Logarithm (...) of the density up to a constant, for k (...)."""
        return -0.5 * (k / self.scale) ** 2

    def gaussian(self) -> tuple[float, float]:
        """Mean and precision of a Gaussian near it."""
        return 0.0, self.scale**-2

    def draw(self, rng: np.random.Generator, n: int) -> Array:
        """Draws (n,) [rad/(N m)]."""
        return self.of_normal(rng.standard_normal(n))

    def of_normal(self, z: Array) -> Array:
        """Values of this density from those of a standard normal variable [rad/(N m)]."""
        return np.abs(self.scale * z)


@dataclass(frozen=True)
class LogNormal:
    """A compliance is known to a factor: log k is normal.

    Attributes:
        median: Its logarithm is the mean of log k [rad/(N m)].
        factor: Its logarithm is the standard deviation of log k.
    """

    median: float
    factor: float

    def log_density(self, k: Array) -> Array:
        """Logarithm (...) of the density up to a constant, for k > 0 (...)."""
        return -0.5 * (np.log(k / self.median) / np.log(self.factor)) ** 2 - np.log(k)

    def gaussian(self) -> tuple[float, float]:
        """Mean and precision of a Gaussian near it."""
        return self.median, (self.median * np.log(self.factor)) ** -2

    def draw(self, rng: np.random.Generator, n: int) -> Array:
        """Draws (n,) [rad/(N m)]."""
        return self.of_normal(rng.standard_normal(n))

    def of_normal(self, z: Array) -> Array:
        """Values of this density from those of a standard normal variable [rad/(N m)]."""
        return np.asarray(self.median * self.factor**z)


Marginal = Flat | HalfNormal | LogNormal


@dataclass(frozen=True, eq=False)
class Normal:
    """The result of an earlier calibration: a normal distribution of all compliances.

    Attributes:
        mean: Estimates (p,) [rad/(N m)].
        covariance: Their covariance (p, p).
    """

    mean: Array
    covariance: Array
    _factor: Array = field(init=False, repr=False)
    _whitener: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        # Factored once: a chain evaluates the density hundreds of thousands of times.
        factor = np.linalg.cholesky(self.covariance)
        # The class is frozen; these two follow from its fields.
        object.__setattr__(self, "_factor", factor)
        object.__setattr__(self, "_whitener", np.linalg.inv(factor).T)

    def log_density(self, k: Array) -> Array:
        """Logarithm (...) of the density up to a constant, for k (..., p)."""
        return -0.5 * (((k - self.mean) @ self._whitener) ** 2).sum(axis=-1)

    def draw(self, rng: np.random.Generator, n: int) -> Array:
        """Draws (n, p) [rad/(N m)], of any sign."""
        return self.mean + rng.standard_normal((n, len(self.mean))) @ self._factor.T


@dataclass(frozen=True, eq=False)
class Prior:
    """A marginal for each compliance, or an earlier calibration, or both; compliances are positive.

    Attributes:
        marginals: One for each of the p compliances.
        earlier: Result of an earlier calibration, a further factor of the density; or None.
        positive: Whether the density is zero where a compliance is not positive.
    """

    marginals: tuple[Marginal, ...]
    earlier: Normal | None = None
    positive: bool = True

    @classmethod
    def flat(cls, p: int, positive: bool = True) -> "Prior":
        """Nothing is known of p compliances, but that they are positive."""
        return cls((Flat(),) * p, positive=positive)

    def log_density(self, k: Array) -> Array:
        """Logarithm (...) of the density up to a constant, for k (..., p); -inf outside."""
        inside = np.ones(k.shape[:-1], dtype=bool)
        if self._bounded:
            inside = np.asarray((k > 0).all(axis=-1))
        # Logarithms want positive numbers, also where their result is thrown away.
        safe = np.where(inside[..., None], k, 1.0)
        total = np.zeros(k.shape[:-1])
        for i, marginal in enumerate(self.marginals):
            if not isinstance(marginal, Flat):
                total = total + marginal.log_density(safe[..., i])
        if self.earlier is not None:
            total = total + self.earlier.log_density(safe)
        return np.where(inside, total, -np.inf)

    def gaussian(self) -> tuple[Array, Array]:
        """A Gaussian near the prior, from which a chain may start.

        Returns:
            Its precision (p, p), and that times its mean (p,).
        """
        pairs = np.array([marginal.gaussian() for marginal in self.marginals])
        precision = np.diag(pairs[:, 1])
        weighted_mean = pairs[:, 0] * pairs[:, 1]
        if self.earlier is not None:
            inverse = np.linalg.inv(self.earlier.covariance)
            precision = precision + inverse
            weighted_mean = weighted_mean + inverse @ self.earlier.mean
        return precision, weighted_mean

    def draw(self, rng: np.random.Generator, n: int) -> Array:
        """Draws (n, p) [rad/(N m)].

        Raises:
            ValueError: A marginal is flat and there is no earlier calibration, or both kinds are
                given; or the earlier calibration is hardly ever positive.
        """
        if self.earlier is None:
            return np.stack([marginal.draw(rng, n) for marginal in self.marginals], axis=-1)
        if any(not isinstance(marginal, Flat) for marginal in self.marginals):
            raise ValueError(
                "an earlier calibration together with other priors cannot be drawn from"
            )
        found = np.empty((0, len(self.marginals)))
        for _ in range(MOST_ROUNDS):
            k = self.earlier.draw(rng, n)
            allowed = k[(k > 0).all(axis=-1)] if self.positive else k
            found = np.concatenate([found, allowed])
            if len(found) >= n:
                return found[:n]
        raise ValueError(
            "of the earlier calibration's normal distribution hardly anything is positive"
        )

    @property
    def is_flat(self) -> bool:
        """Whether nothing is known, but that compliances are positive."""
        return self.earlier is None and all(isinstance(m, Flat) for m in self.marginals)

    @property
    def proper(self) -> bool:
        """Whether every compliance has a prior of finite mass and moments."""
        return self.earlier is not None or not any(isinstance(m, Flat) for m in self.marginals)

    @property
    def _bounded(self) -> bool:
        return self.positive or any(not isinstance(m, Flat) for m in self.marginals)
