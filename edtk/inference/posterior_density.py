"""The posterior density of the compliances, in coordinates that suit a sampler."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from edtk.inference.chain_file import ChainFile
from edtk.inference.draw_positive import draw_positive
from edtk.inference.least_squares import Estimate
from edtk.inference.noise import Noise
from edtk.inference.prior import Prior
from edtk.inference.whiten import RowNoise, whiten, whiten_columns
from edtk.system.typing import Array

# emcee's differential evolution moves along differences of two other walkers, which must span the
# space; twice the dimension is the least that it accepts.
WALKERS_PER_PARAMETER = 4

# A fit is exact where the squares of its residuals are this share of those of the measurements:
# rounding to 1e-11.
EXACT = 1e-22


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
        return self.squares <= EXACT * float(self.y @ self.y)


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

    def file(self, path: Path | None, content: list[Array]) -> ChainFile | None:
        """The file at a path that is of this problem alone; None without a path.

        Args:
            path: Where it lies.
            content: Every number that the chain depends on, but for this density's own.
        """
        if path is None:
            return None
        numbers = self.parameters(np.eye(len(self.coordinates.centre) + len(self.noise.names)))
        parts = [np.ascontiguousarray(part).tobytes() for part in (*content, numbers)]
        digest = hashlib.sha256(b"".join(parts))
        digest.update(repr((self.prior, self.noise)).encode())
        return ChainFile(path, digest.hexdigest())
