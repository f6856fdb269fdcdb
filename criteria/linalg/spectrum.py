"""Extreme eigenvalues of an information matrix in whitened parameters, as cvxpy sees them."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import cvxpy as cp

Array = NDArray[np.float64]


def extremes(T: Array) -> tuple[float, float]:
    """Least and largest eigenvalue of the information that T whitens, ``(T T')^-1``."""
    s = np.linalg.svd(T, compute_uv=False)
    return float(s[0] ** -2), float(s[-1] ** -2)


def parts(Z: Array) -> Array:
    """``trace(Z+)`` and ``trace(Z-)`` (2, ...) of ``Z = Z+ - Z-`` (..., p, p), neither part on the lucky side.

    The positive part is lowered and the negative one raised by what is lost in rounding. Only a Z that is positive
    semidefinite, as judged after scaling to a unit diagonal, has no negative part.
    """
    z = np.linalg.eigvalsh(Z)
    lost = 16 * z.shape[-1] * np.finfo(float).eps * np.abs(z).max(axis=-1)
    positive, negative = np.maximum(z, 0.0).sum(axis=-1), -np.minimum(z, 0.0).sum(axis=-1)
    d = np.sqrt(np.abs(np.diagonal(Z, axis1=-2, axis2=-1)))
    d = np.where(d > 0, d, 1.0)
    least = np.linalg.eigvalsh(Z / (d[..., :, None] * d[..., None, :]))[..., 0]
    psd = least >= -16 * z.shape[-1] * np.finfo(float).eps
    return np.stack([np.maximum(positive - lost, 0.0), np.where(psd, 0.0, negative + lost)])


def bounded_below(M: "cp.Expression", T: Array) -> "cp.Constraint":
    """``T^-T M T^-1 >= l I`` as ``M >= l T'T``, with l the least eigenvalue of what T whitens."""
    return M >> extremes(T)[0] * (T.T @ T)


def largest(M: "cp.Expression", T: Array) -> "cp.Expression":
    """Largest eigenvalue of ``T^-T M T^-1``, divided by that of what T whitens."""
    import cvxpy as cp

    S = np.linalg.inv(T) / np.sqrt(extremes(T)[1])
    X = S.T @ M @ S
    return cp.lambda_max(0.5 * (X + X.T))
