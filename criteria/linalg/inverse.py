"""Inverses and roots of information matrices; singular matrices are marked, not raised."""

import numpy as np

from criteria.linalg.root import unit_spectrum
from criteria.linalg.typing import Array, Mask

EPS = np.finfo(float).eps
# Eigenvalues of a (p, p) matrix scaled to a unit diagonal are known to a small multiple of p eps;
# below 16 p eps they are noise.
ROUNDING = 16 * EPS


def guarded_inverse(M: Array, least: float = 0.0) -> tuple[Array, Array, Mask]:
    """Invert symmetric positive semidefinite matrices after scaling them to a unit diagonal.

    With ``d = sqrt(diag M)`` the scaled matrix ``R = M / (d d')`` has the same rank, and its
    spectrum does not depend on the units of the parameters. M counts as singular where the least
    eigenvalue of R is lost in rounding, below ``16 p eps``. The eigenvectors V and eigenvalues r of
    R give the inverse ``cov = V diag(1/r) V' / (d d')``.

    Args:
        M: Array (..., p, p), symmetric.
        least: A larger threshold for the least eigenvalue of R, where inverses must be accurate.

    Returns:
        ``(safe, cov, regular)``: M and its inverse, both with the identity in place of singular or
        non-finite members, and the mask (...) of the regular ones.
    """
    p = M.shape[-1]
    diagonal = np.diagonal(M, axis1=-2, axis2=-1)
    is_positive = (diagonal > 0).all(axis=-1)
    positive = np.asarray(np.isfinite(M).all(axis=(-2, -1)) & is_positive)
    safe = _with_identity(positive, M)
    d = np.sqrt(np.diagonal(safe, axis1=-2, axis2=-1))
    dd = d[..., :, None] * d[..., None, :]
    r, V = np.linalg.eigh(safe / dd)
    regular = positive & (r[..., 0] > max(least, p * ROUNDING))
    r = r if regular.all() else np.where(regular[..., None], r, 1.0)
    cov = (V / r[..., None, :]) @ np.swapaxes(V, -1, -2) / dd
    return _with_identity(regular, safe), _with_identity(regular, cov), regular


def _with_identity(kept: Mask, M: Array) -> Array:
    """Matrices (..., p, p), with the identity in place of those that are not kept."""
    if kept.all() and M.flags.c_contiguous:
        return M
    return np.where(kept[..., None, None], M, np.eye(M.shape[-1]))


def whitener(M: Array) -> Array:
    """T (p, p) with ``T' M T = I`` of a regular M (p, p).

    It comes from a Cholesky factor of M scaled to a unit diagonal: bad units cost no digits.
    """
    d = np.sqrt(np.diag(M))
    factor = np.linalg.cholesky(M / np.outer(d, d))
    return np.asarray(np.linalg.inv(factor.T) / d[:, None])


def power_trace(Z: Array, power: float) -> float:
    """``trace(Z^power)`` of a positive semidefinite Z (p, p), never overestimated by rounding.

    Args:
        Z: Symmetric positive semidefinite matrix (p, p).
        power: In (0, 1].
    """
    # Singular values of a root of Z, formed after scaling, are exact for small eigenvalues of a Z
    # in bad units; eigenvalues of Z itself are not.
    return power_trace_of_root(lowered_root(Z), power)


def lowered_root(Z: Array) -> Array:
    """F (p, p) with ``F'F`` at most Z but for rounding, for a positive semidefinite Z (p, p)."""
    r, V, d = unit_spectrum(Z)
    # An eigenvalue lost in rounding counts as zero: its root would be far larger than the rounding.
    r = np.where(r > len(Z) * ROUNDING * r[-1], r, 0.0)
    return np.asarray(np.sqrt(r)[:, None] * V.T * d)


def power_trace_of_root(F: Array, power: float) -> float:
    """``trace((F'F)^power)`` of a root F (p, q), never overestimated by rounding."""
    s = np.linalg.svd(F, compute_uv=False)
    lowered = np.maximum(s - 4 * len(F) * EPS * s[0], 0.0)
    return float((lowered ** (2 * power)).sum())


def scaled_inverse(variance: Array) -> Array:
    """Inverse (..., s, s) of regular covariances, which are not checked."""
    # Combinations in different units would cost digits, hence the scaling to a unit diagonal.
    d = np.sqrt(np.diagonal(variance, axis1=-2, axis2=-1))
    dd = d[..., :, None] * d[..., None, :]
    return np.linalg.inv(variance / dd) / dd
