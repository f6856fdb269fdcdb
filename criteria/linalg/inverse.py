"""Inverses and roots of information matrices, with what is lost in rounding marked instead of raised."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def guarded_inverse(M: Array, least: float = 0.0) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Invert symmetric positive semidefinite matrices after scaling them to a unit diagonal.

    With ``d = sqrt(diag M)`` the scaled matrix ``R = M / (d d')`` has the same rank, and its spectrum does not
    depend on the units of the parameters; M counts as singular where the least eigenvalue of R is lost in
    rounding, below ``16 p eps``. The eigenvectors of R give the inverse: ``cov = V diag(1/r) V' / (d d')``.

    Args:
        M: Array (..., p, p), symmetric.
        least: A larger threshold for the least eigenvalue of R, where inverses are to be accurate.

    Returns:
        ``(safe, cov, regular)``: M and its inverse, both with the identity in place of singular or non-finite
        members, and the mask (...) of the regular ones.
    """
    p = M.shape[-1]
    diagonal = np.diagonal(M, axis1=-2, axis2=-1)
    positive = np.asarray(np.isfinite(M).all(axis=(-2, -1)) & (diagonal > 0).all(axis=-1))
    safe = np.where(positive[..., None, None], M, np.eye(p))
    d = np.sqrt(np.diagonal(safe, axis1=-2, axis2=-1))
    dd = d[..., :, None] * d[..., None, :]
    r, V = np.linalg.eigh(safe / dd)
    regular = positive & (r[..., 0] > max(least, 16 * p * np.finfo(float).eps))
    r = np.where(regular[..., None], r, 1.0)
    cov = (V / r[..., None, :]) @ np.swapaxes(V, -1, -2) / dd
    keep = regular[..., None, None]
    return np.where(keep, safe, np.eye(p)), np.where(keep, cov, np.eye(p)), regular


def whitener(M: Array) -> Array:
    """T (p, p) with ``T' M T = I``, by a Cholesky factor of M scaled to a unit diagonal: M is regular."""
    d = np.sqrt(np.diag(M))
    return np.asarray(np.linalg.inv(np.linalg.cholesky(M / np.outer(d, d)).T) / d[:, None])


def power_trace(Z: Array, power: float) -> float:
    """``trace(Z^power)`` of a positive semidefinite Z (p, p), power in (0, 1], never overestimated by rounding.

    Eigenvalues lost in rounding count as zero: their roots would be far larger than the rounding itself. They are
    taken as squared singular values of a root of Z, which is formed after scaling to a unit diagonal: so the small
    ones of a Z in bad units are exact too.
    """
    d = np.sqrt(np.maximum(np.diag(Z), 0.0))
    d = np.where(d > 0, d, 1.0)
    r, V = np.linalg.eigh(Z / np.outer(d, d))
    r = np.where(r > 16 * len(Z) * np.finfo(float).eps * r[-1], r, 0.0)
    s = np.linalg.svd(np.sqrt(r)[:, None] * V.T * d, compute_uv=False)
    return float(
        (np.maximum(s - 4 * len(Z) * np.finfo(float).eps * s[0], 0.0) ** (2 * power)).sum()
    )
