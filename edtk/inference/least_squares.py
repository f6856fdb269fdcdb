"""Least-squares estimate of the compliances and its covariance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from criteria.linalg.inverse import guarded_inverse
from criteria.linalg.null_space import null_space, open_directions

Array = NDArray[np.float64]


class SingularPlanError(ValueError):
    """The plan cannot identify all parameters; the message names those that it leaves open."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """Estimated compliances.

    Attributes:
        k: Estimates (..., p) [rad/(N m)].
        covariance: Their covariance (p, p), Eq. (13).
    """

    k: Array
    covariance: Array


def unidentified(M: Array, parameters: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the parameters that take part in a direction which the information M (p, p) does not excite."""
    involved = np.any(null_space(M)[0] != 0, axis=1).tolist()
    return tuple(name for name, yes in zip(parameters, involved, strict=True) if yes)


def covariance(M: Array, parameters: tuple[str, ...]) -> Array:
    """Eq. (13): ``cov(k) = (sum A_i' A_i / sigma^2)^-1`` (p, p).

    Args:
        M: Information matrix (p, p).
        parameters: Names (p,), for the error message.

    Raises:
        SingularPlanError: M is singular; names the parameters concerned, and the directions where they are several.
    """
    _, cov, regular = guarded_inverse(M)
    if not regular:
        names = ", ".join(unidentified(M, parameters)) or ", ".join(parameters)
        directions = [d for d in open_directions(M, parameters) if d not in parameters]
        along = (
            f"; nothing is known along {' and '.join(f'({d})' for d in directions)}"
            if directions
            else ""
        )
        raise SingularPlanError(
            f"the plan cannot identify all parameters: {names} cannot be told from its measurements{along}"
        )
    return cov


def estimate(A: Array, measured: Array, sigma: ArrayLike, parameters: tuple[str, ...]) -> Estimate:
    """Eq. (6), (9): ``k = (sum A_i'A_i)^-1 sum A_i' dp_i``, rows weighted by 1/sigma^2; solved by QR.

    Args:
        A: Regressors (m, rows, p).
        measured: Deflections (..., m, rows) [m, rad].
        sigma: Noise, one number, one per row (rows,) or one per measurement and row (m, rows).
        parameters: Names (p,), for the error message.

    Raises:
        SingularPlanError: The regressors do not identify all parameters.
    """
    whitened = Whitened.of(A, sigma, parameters)
    return Estimate(whitened.solve(measured), whitened.covariance)


@dataclass(frozen=True, eq=False)
class Whitened:
    """Regressors in units of the noise, factored once: ``A / sigma = Q R diag(scale)`` with ``Q'Q = I``.

    Attributes:
        Q: Orthonormal columns (m, rows, p).
        R: Upper triangle (p, p) of columns of unit length.
        scale: Length (p,) of each column of A/sigma.
        weight: 1/sigma (m, rows).
        covariance: Eq. (13) (p, p).
    """

    Q: Array
    R: Array
    scale: Array
    weight: Array
    covariance: Array

    @classmethod
    def of(cls, A: Array, sigma: ArrayLike, parameters: tuple[str, ...]) -> "Whitened":
        """Factor regressors (m, rows, p) with noise that broadcasts to (m, rows).

        Raises:
            SingularPlanError: The regressors do not identify all parameters.
        """
        weight = 1.0 / np.broadcast_to(np.asarray(sigma, dtype=float), A.shape[:2])
        stacked = (A * weight[..., None]).reshape(-1, A.shape[-1])
        covariance(stacked.T @ stacked, parameters)  # refuses what is singular
        scale = np.linalg.norm(stacked, axis=0)
        Q, R = np.linalg.qr(stacked / scale)
        inverse = np.linalg.inv(R) / scale[:, None]
        return cls(Q.reshape(A.shape), R, scale, weight, inverse @ inverse.T)

    def project(self, measured: Array) -> Array:
        """``Q' (dp / sigma)`` (..., p): all that deflections (..., m, rows) say about the parameters."""
        y = (measured * self.weight).reshape(*measured.shape[:-2], -1)
        return y @ self.Q.reshape(-1, len(self.scale))

    def solve(self, measured: Array) -> Array:
        """Least-squares estimates (..., p) from deflections (..., m, rows)."""
        return np.linalg.solve(self.R, self.project(measured)[..., None])[..., 0] / self.scale
