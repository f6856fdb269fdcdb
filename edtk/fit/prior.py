"""Prior knowledge of parameters, and estimates from measurements and prior together."""

from dataclasses import dataclass, field, replace
from math import log

import numpy as np

from edtk.fit.correlated_noise import CorrelatedNoise, NoiseBlocks, RowNoise, whiten, whiten_columns
from edtk.fit.least_squares import Estimate, Whitened
from edtk.system.typing import Array, Indices, Mask

# Of two coordinates, a sweep multiplies the memory of the start by their squared correlation: at
# 0.98 less than 2 % of it remain.
SWEEPS = 100
# Draws from an earlier calibration that are not positive are thrown away and drawn again. After so
# many rounds nearly all of its mass is where no compliance can be, which is worth an error.
DRAW_ROUNDS = 1000
SAME_COLUMN = 1e-8  # of a column, which others leave of it where they do the same
NEAR = 4.0  # standard deviations of a logarithm, within which it is linearised about an estimate


def draw_positive(mean: Array, precision: Array, n: int, rng: np.random.Generator) -> Array:
    """Draw from where no tail is too far to be hit, by Gibbs sampling of one coordinate at a time.

    Given the others, coordinate i is normal about ``m_i - sum_j P_ij (x_j - m_j) / P_ii``, j other
    than i, with variance 1/P_ii, and confined to positive numbers.

    Args:
        mean: m (p,), any sign.
        precision: P (p, p); coordinates should be of like scale.
        n: Number of independent draws.
        rng: Source of randomness.

    Returns:
        Draws (n, p), all positive.
    """
    from scipy.stats import truncnorm

    x = np.tile(np.abs(mean), (n, 1))
    spread = 1 / np.sqrt(np.diag(precision))
    for _ in range(SWEEPS):
        for i in range(len(mean)):
            pull = (x - mean) @ precision[:, i] - (x[:, i] - mean[i]) * precision[i, i]
            centre = mean[i] - pull * spread[i] ** 2
            lower = -centre / spread[i]
            x[:, i] = truncnorm.rvs(lower, np.inf, centre, spread[i], random_state=rng)
    return x


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


@dataclass(frozen=True)
class Gaussian:
    """A parameter is known to a standard deviation: it is normal.

    Attributes:
        mean: Its mean, in SI units: zero is the drawing of a length or an angle.
        std: Its standard deviation.
    """

    mean: float
    std: float

    def log_density(self, k: Array) -> Array:
        """Logarithm (...) of the density up to a constant, for k (...)."""
        return -0.5 * ((k - self.mean) / self.std) ** 2

    def gaussian(self) -> tuple[float, float]:
        """Mean and precision: its own."""
        return self.mean, self.std**-2

    def draw(self, rng: np.random.Generator, n: int) -> Array:
        """Draws (n,), of any sign."""
        return self.of_normal(rng.standard_normal(n))

    def of_normal(self, z: Array) -> Array:
        """Values of this density from those of a standard normal variable."""
        return np.asarray(self.mean + self.std * z)


Marginal = Flat | HalfNormal | LogNormal | Gaussian


@dataclass(frozen=True, eq=False)
class Normal:
    """The result of an earlier calibration: a normal distribution of parameters.

    Attributes:
        mean: Estimates (r,) in SI units, of compliances [rad/(N m)].
        covariance: Their covariance (r, r).
        columns: Combinations C (r, p) of all parameters that the estimates are of, ``C k``; None
            where these are the parameters themselves.
        basis: Indices of the parameters that were estimated together; those of which nothing is
            said any more, as a place that is another one today, have columns of zeros.
    """

    mean: Array
    covariance: Array
    columns: Array | None = None
    basis: tuple[int, ...] = ()
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
        told = k if self.columns is None else k @ self.columns.T
        return -0.5 * (((told - self.mean) @ self._whitener) ** 2).sum(axis=-1)

    def of(self, chosen: Indices) -> "Normal":
        """The same of some parameters, where the others are zero, or hang on these."""
        if self.columns is None:
            return self
        return replace(self, columns=self.columns[:, chosen])

    def completed(self, moves: Array, scales: Array) -> "Normal":
        """The same with the parameters that could not be told from those that were estimated.

        Where a parameter moves all that is measured as a combination c of the estimated ones does,
        the estimates are of these and c times that parameter.

        Args:
            moves: How all parameters move what is measured (rows, p), a unit of each.
            scales: Those units (p,) in SI.
        """
        if self.columns is None or not self.basis:
            return self
        own = list(self.basis)
        columns = np.array(self.columns)
        for j in np.flatnonzero(~columns.any(axis=0)):
            size = np.linalg.norm(moves[:, j])
            c = np.linalg.lstsq(moves[:, own], moves[:, j], rcond=None)[0]
            left = np.linalg.norm(moves[:, j] - moves[:, own] @ c)
            if j not in own and 0 < left <= SAME_COLUMN * size:
                columns[:, j] = (columns[:, own] * scales[own]) @ c / scales[j]
        return replace(self, columns=columns)

    def gaussian(self) -> tuple[Array, Array]:
        """Precision (p, p) of all parameters, and that times their mean (p,)."""
        precision: Array = np.asarray(np.linalg.inv(self.covariance), dtype=float)
        weighted_mean = precision @ self.mean
        if self.columns is None:
            return precision, weighted_mean
        return self.columns.T @ precision @ self.columns, self.columns.T @ weighted_mean

    def rows(self) -> tuple[Array, Array]:
        """Rows (r, p) and values (r,) with errors of size one that say the same."""
        whitener = np.linalg.inv(np.linalg.cholesky(self.covariance))
        rows: Array = whitener if self.columns is None else whitener @ self.columns
        return rows, whitener @ self.mean

    def draw(self, rng: np.random.Generator, n: int) -> Array:
        """Draws (n, r), of any sign."""
        return self.mean + rng.standard_normal((n, len(self.mean))) @ self._factor.T


@dataclass(frozen=True, eq=False)
class Prior:
    """A marginal for each parameter, or an earlier calibration, or both.

    Attributes:
        marginals: One for each of the p parameters: compliances, lengths and angles, in SI units.
        earlier: Result of an earlier calibration, a further factor of the density; or None.
        positive: Whether the density is zero where a parameter is not positive, as compliances are.
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
        inside = np.asarray((k[..., self._bounded] > 0).all(axis=-1))
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
            of_earlier = self.earlier.gaussian()
            precision = precision + of_earlier[0]
            weighted_mean = weighted_mean + of_earlier[1]
        return precision, weighted_mean

    def of(self, chosen: Indices) -> "Prior":
        """The same of some parameters, where nothing is known of the others by themselves."""
        marginals = tuple(self.marginals[i] for i in chosen)
        return replace(
            self,
            marginals=marginals,
            earlier=None if self.earlier is None else self.earlier.of(chosen),
        )

    def draw(self, rng: np.random.Generator, n: int) -> Array:
        """Draws (n, p) [rad/(N m)].

        Raises:
            ValueError: A marginal is flat and there is no earlier calibration, or both kinds are
                given; or the earlier calibration is hardly ever positive.
        """
        both = any(not isinstance(marginal, Flat) for marginal in self.marginals)
        if self.earlier is not None and both:
            raise ValueError(
                "an earlier calibration together with other priors cannot be drawn from"
            )
        found = np.empty((0, len(self.marginals)))
        for _ in range(DRAW_ROUNDS):
            k = (
                np.stack([marginal.draw(rng, n) for marginal in self.marginals], axis=-1)
                if self.earlier is None
                else self.earlier.draw(rng, n)
            )
            allowed = k[(k > 0).all(axis=-1)] if self.positive else k
            found = np.concatenate([found, allowed])
            if len(found) >= n:
                return found[:n]
        raise ValueError("of the prior's normal distribution hardly anything is positive")

    @property
    def with_weak(self) -> "Prior":
        """The same where measurements alone do not tell all: half-normal densities say sizes."""
        marginals = [
            Gaussian(0.0, one.scale) if isinstance(one, HalfNormal) else one
            for one in self.marginals
        ]
        return replace(self, marginals=tuple(marginals))

    @property
    def is_flat(self) -> bool:
        """Whether nothing is known, but perhaps that parameters are positive."""
        return self.earlier is None and all(isinstance(m, Flat) for m in self.marginals)

    @property
    def proper(self) -> bool:
        """Whether every parameter has a prior of finite mass and moments."""
        return self.earlier is not None or not any(isinstance(m, Flat) for m in self.marginals)

    @property
    def _bounded(self) -> Mask:
        """Which parameters (p,) are positive."""
        own = [isinstance(one, HalfNormal | LogNormal) for one in self.marginals]
        return np.array(own, dtype=bool) | self.positive


@dataclass(frozen=True, eq=False)
class PriorRows:
    """Knowledge of compliances beside measurements: ``rows k = values``, with noise of size one.

    They are appended to the rows of measurements, in measurements of their own, whose other
    coordinates say nothing.

    Attributes:
        rows: Regressors (r, p), of compliances [1/(rad/(N m))].
        values: Their right-hand sides (r,).
        parameters: Of which parameter each of the first rows is; the others are of an earlier
            calibration, all together.
    """

    rows: Array
    values: Array
    parameters: tuple[int, ...] = ()

    @classmethod
    def none(cls, p: int) -> "PriorRows":
        """Nothing is known of p parameters."""
        return cls(np.zeros((0, p)), np.zeros(0))

    @classmethod
    def of_gaussian(cls, prior: Prior) -> "PriorRows":
        """Rows that say the same as `Prior.gaussian`, which knows no estimate."""
        pairs = np.array([marginal.gaussian() for marginal in prior.marginals])
        told = np.flatnonzero(pairs[:, 1] > 0)
        root = np.sqrt(pairs[told, 1])
        rows = np.eye(len(pairs))[told] * root[:, None]
        values = pairs[told, 0] * root
        if prior.earlier is not None:
            own = prior.earlier.rows()
            rows, values = np.concatenate([rows, own[0]]), np.append(values, own[1])
        return cls(rows, values, tuple(told.tolist()))

    @classmethod
    def near(cls, prior: Prior, k: Array) -> "PriorRows":
        """Linearise a prior about parameters.

        Of a compliance that is known to a factor the logarithm is normal: ``log k`` is
        ``log k0 + (k - k0) / k0`` near k0.

        Args:
            prior: Knowledge of the parameters; flat and half-normal densities are left out, as
                these say nothing of a compliance's size but that it is not large.
            k: The parameters (p,) about which it is linearised, in SI units.
        """
        p = len(k)
        rows = []
        values = []
        told = []
        for i, marginal in enumerate(prior.marginals):
            if isinstance(marginal, LogNormal | Gaussian):
                told.append(i)
            if isinstance(marginal, Gaussian):
                rows.append(np.eye(p)[i] / marginal.std)
                values.append(marginal.mean / marginal.std)
            if isinstance(marginal, LogNormal):
                std = log(marginal.factor)
                near = k[i] > 0 and abs(log(k[i] / marginal.median)) < NEAR * std
                about = k[i] if near else marginal.median
                rows.append(np.eye(p)[i] / (about * std))
                values.append((log(marginal.median / about) + 1) / std)
        if prior.earlier is not None:
            earlier = prior.earlier.rows()
            rows += list(earlier[0])
            values += list(earlier[1])
        return cls(np.array(rows).reshape(-1, p), np.array(values), tuple(told))

    def scaled(self, scales: Array, weight: float = 1.0) -> "PriorRows":
        """The same for parameters in other units, ``k = scales u``, and errors of another size."""
        return replace(self, rows=weight * self.rows * scales, values=weight * self.values)

    def of(self, chosen: Indices) -> "PriorRows":
        """The same of some parameters; all rows stay."""
        place = {int(old): new for new, old in enumerate(chosen)}
        told = tuple(place.get(i, -1) for i in self.parameters)
        return replace(self, rows=self.rows[:, chosen], parameters=told)

    def __len__(self) -> int:
        return len(self.values)

    def below(self, A: Array) -> Array:
        """Regressors (m, rows, p) of measurements, with those of the prior below them."""
        coordinates = A.shape[1]
        own = np.zeros((self._count(coordinates) * coordinates, A.shape[-1]))
        own[: len(self)] = self.rows
        return np.concatenate([A, own.reshape(-1, coordinates, A.shape[-1])])

    def measured_below(self, measured: Array) -> Array:
        """Deflections (m, rows), with the values of the prior below them."""
        coordinates = measured.shape[1]
        own = np.zeros(self._count(coordinates) * coordinates)
        own[: len(self)] = self.values
        return np.concatenate([measured, own.reshape(-1, coordinates)])

    def zeros_below(self, change: Array) -> Array:
        """Changes (..., m, rows) of measurements, which leave the prior as it is."""
        extra = self._count(change.shape[-1])
        return np.concatenate([change, np.zeros((*change.shape[:-2], extra, change.shape[-1]))], -2)

    def noise_below(self, noise: RowNoise, coordinates: int) -> RowNoise:
        """The noise of measurements, with that of size one below it."""
        extra = self._count(coordinates)
        if not isinstance(noise, CorrelatedNoise):
            return np.concatenate([noise, np.ones((extra, coordinates))])
        m = noise.shape[0]
        own = NoiseBlocks(
            m + np.arange(extra)[:, None], np.tile(np.eye(coordinates), (extra, 1, 1))
        )
        return CorrelatedNoise.of([*noise.blocks, own], (m + extra, coordinates))

    def _count(self, coordinates: int) -> int:
        """Measurements of so many coordinates that hold all rows."""
        return -(-len(self) // coordinates)


def fit_with_prior(
    A: Array, measured: Array, sigma: RowNoise, parameters: tuple[str, ...], prior: Prior
) -> Estimate:
    """Fit compliances to measurements, with a Gaussian near the prior as further rows.

    With the precision P of that Gaussian, rows F of noise of size one say the same, ``F'F = P``. So
    the covariance is ``(A' A / sigma^2 + P)^-1``, found from rows, by QR.

    Args:
        A: Regressors (m, rows, p) [m/(rad/(N m))].
        measured: Deflections (m, rows) [m, rad].
        sigma: Noise that broadcasts to (m, rows) [m, rad], or correlated noise.
        parameters: Names (p,).
        prior: Knowledge of the compliances; a flat one says nothing.

    Returns:
        The estimate, which may be negative, and its covariance.

    Raises:
        SingularPlanError: Prior and measurements together say nothing of a parameter.
    """
    known = PriorRows.of_gaussian(prior)
    p = A.shape[-1]
    seen = _in_sigma(A, measured, sigma)
    X = np.concatenate([seen[0].reshape(-1, p), known.rows])
    y = np.concatenate([seen[1].ravel(), known.values])
    whitened = Whitened.of(X[:, None], 1.0, parameters)
    return Estimate(whitened.solve(y[:, None]), whitened.covariance, parameters)


def _in_sigma(A: Array, measured: Array, sigma: RowNoise) -> tuple[Array, Array]:
    """Regressors (m, rows, p) and deflections (m, rows) in units of the noise."""
    if isinstance(sigma, CorrelatedNoise):
        return whiten_columns(A, sigma), whiten(measured, sigma)
    weight = 1 / np.broadcast_to(np.asarray(sigma, dtype=float), measured.shape)
    return A * weight[..., None], measured * weight
