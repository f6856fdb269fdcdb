"""Inverses and roots of information matrices, with what is lost in rounding marked instead of raised."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def guarded_inverse(M: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Invert symmetric positive semidefinite matrices after scaling them to a unit diagonal.

    With ``d = sqrt(diag M)`` the scaled matrix ``R = M / (d d')`` has the same rank, and its spectrum does not
    depend on the units of the parameters; M counts as singular where the least eigenvalue of R is lost in
    rounding, below ``16 p eps``. The eigenvectors of R give the inverse: ``cov = V diag(1/r) V' / (d d')``.

    Args:
        M: Array (..., p, p), symmetric.

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
    regular = positive & (r[..., 0] > 16 * p * np.finfo(float).eps)
    r = np.where(regular[..., None], r, 1.0)
    cov = (V / r[..., None, :]) @ np.swapaxes(V, -1, -2) / dd
    keep = regular[..., None, None]
    return np.where(keep, safe, np.eye(p)), np.where(keep, cov, np.eye(p)), regular


def root_trace(Z: Array) -> float:
    """``trace(Z^(1/2))`` of a positive semidefinite Z (p, p), never overestimated by rounding.

    Eigenvalues lost in rounding count as zero: their roots would be far larger than the rounding itself.
    """
    z = np.linalg.eigvalsh(Z)
    return float(np.sqrt(z[z > 16 * len(Z) * np.finfo(float).eps * z[-1]]).sum())
