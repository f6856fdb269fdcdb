"""Least-squares estimate of the compliances and its covariance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from criteria.inverse import guarded_inverse

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
    """Names of the parameters that take part in a direction which the information M (p, p) does not excite.

    The null space is taken of M scaled to a unit diagonal, so that units do not matter.
    """
    d = np.sqrt(np.maximum(np.diag(M), 0.0))
    open_ = d == 0
    scale = np.where(open_, 1.0, d)
    r, V = np.linalg.eigh(np.where(np.eye(len(M), dtype=bool) & open_, 0.0, M / np.outer(scale, scale)))
    null = V[:, r <= 16 * len(M) * np.finfo(float).eps * max(r[-1], 1.0)]
    involved = np.linalg.norm(null, axis=1) > 1e-4
    return tuple(name for name, yes in zip(parameters, involved, strict=True) if yes)


def covariance(M: Array, parameters: tuple[str, ...]) -> Array:
    """Eq. (13): ``cov(k) = (sum A_i' A_i / sigma^2)^-1`` (p, p).

    Args:
        M: Information matrix (p, p).
        parameters: Names (p,), for the error message.

    Raises:
        SingularPlanError: M is singular; names the parameters concerned.
    """
    _, cov, regular = guarded_inverse(M)
    if not regular:
        names = ", ".join(unidentified(M, parameters)) or ", ".join(parameters)
        raise SingularPlanError(
            f"the plan cannot identify all parameters: {names} cannot be told from its measurements"
        )
    return cov


def estimate(A: Array, measured: Array, sigma: ArrayLike, parameters: tuple[str, ...]) -> Estimate:
    """Eq. (6), (9): ``k = (sum A_i'A_i)^-1 sum A_i' dp_i``, rows weighted by 1/sigma^2; solved by QR.

    Args:
        A: Regressors (m, rows, p).
        measured: Deflections (..., m, rows) [m, rad].
        sigma: Noise, one number or one per row (rows,).
        parameters: Names (p,), for the error message.

    Raises:
        SingularPlanError: The regressors do not identify all parameters.
    """
    weight = 1.0 / np.broadcast_to(np.asarray(sigma, dtype=float), A.shape[1:2])
    stacked = (A * weight[:, None]).reshape(-1, A.shape[-1])
    cov = covariance(stacked.T @ stacked, parameters)
    scale = np.linalg.norm(stacked, axis=0)
    Q, R = np.linalg.qr(stacked / scale)
    y = (measured * weight).reshape(*measured.shape[:-2], -1)
    k = np.linalg.solve(R, (y @ Q)[..., None])[..., 0] / scale
    return Estimate(k, cov)
