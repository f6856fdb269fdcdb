"""Eigenpairs, inverses and roots of information matrices; singular ones are marked, not raised."""

import numpy as np
from numpy.typing import ArrayLike

from criteria.linalg.typing import Array, Mask

# Negative part of a weight matrix, at unit diagonal, that counts as rounding of whoever made it:
# sums of a million squares lose ten digits at most.
NEGATIVE = 1e-10


EPS = float(np.finfo(float).eps)
# Eigenvalues of a (p, p) matrix scaled to a unit diagonal are known to a small multiple of p eps;
# below 16 p eps they are noise.
ROUNDING = 16 * EPS
TINY = 1e-300  # what nothing counts as where it is divided by, or its logarithm is taken


def eigenpairs(M: Array) -> tuple[Array, Array]:
    """Eigenvalues (..., n), ascending, and eigenvectors (..., n, n) of symmetric M (..., n, n).

    NumPy calls LAPACK's divide and conquer, which on rare occasions does not converge for an
    ordinary matrix of more than 25 columns. QR iterations, which are slower, find its eigenvalues.
    Of a matrix that is not finite there are none: NumPy returns NaN, or says that it did not
    converge.

    Raises:
        LinAlgError: QR iterations do not converge either, or were not tried, as M is not finite.
    """
    try:
        values, V = np.linalg.eigh(M)
    except np.linalg.LinAlgError:
        if not np.isfinite(M).all():
            raise
        from scipy.linalg import eigh

        if M.ndim > 2:
            pairs = [eigenpairs(one) for one in M]
            return np.stack([one for one, _ in pairs]), np.stack([one for _, one in pairs])
        values, V = eigh(M, driver="ev")
    return values, V


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
    is_positive = (M.diagonal(axis1=-2, axis2=-1) > 0).all(axis=-1)
    positive = np.asarray(np.isfinite(M).all(axis=(-2, -1)) & is_positive)
    safe = _with_identity(positive, M)
    d = np.sqrt(safe.diagonal(axis1=-2, axis2=-1))
    dd = d[..., :, None] * d[..., None, :]
    r, V = eigenpairs(safe / dd)
    regular = positive & (r[..., 0] > max(least, p * ROUNDING))
    is_regular = regular.all()
    if not is_regular:
        r = np.where(regular[..., None], r, 1.0)
        safe = _with_identity(regular, safe)
    cov = (V / r[..., None, :]) @ V.swapaxes(-1, -2)
    cov /= dd
    return safe, cov if is_regular else _with_identity(regular, cov), regular


def _with_identity(kept: Mask, M: Array) -> Array:
    """Matrices (..., p, p), with the identity in place of those that are not kept."""
    if kept.all() and M.flags.c_contiguous:
        return M
    return np.where(kept[..., None, None], M, np.eye(M.shape[-1]))


def whitener(M: Array) -> Array:
    """T (p, p) with ``T' M T = I`` of a regular M (p, p).

    It comes from a Cholesky factor of M scaled to a unit diagonal: bad units cost no digits. LAPACK
    is called as it is: the checks around it take longer than a few parameters do.

    Raises:
        LinAlgError: M is not positive definite to working precision.
    """
    from scipy.linalg.lapack import dpotrf, dtrtri

    diagonal = M.diagonal()
    if diagonal.min(initial=1.0) > 0:
        d = np.sqrt(diagonal)
        factor, failed = dpotrf(M / (d[:, None] * d))
        if not failed:
            return np.asarray(dtrtri(factor, overwrite_c=1)[0] / d[:, None])
    raise np.linalg.LinAlgError("the matrix is not positive definite")


def whitener_of_regular(M: Array) -> Array | None:
    """`whitener` of an M (p, p) that counts as regular in `guarded_inverse`; None of others.

    With R = M at unit diagonal, ``sum_i M_ii (T T')_ii = trace(R^-1)`` is at least the inverse of
    the least eigenvalue of R. So a Cholesky factor tells it, in a fraction of the time.
    """
    try:
        T = whitener(M)
    except np.linalg.LinAlgError:
        return None
    is_regular = len(M) * ROUNDING * (M.diagonal() @ np.square(T).sum(axis=1)) < 1
    return T if is_regular else None


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


def root(M: Array) -> Array:
    """F (..., p, p) with ``F'F = M`` of positive semidefinite M (..., p, p), also singular.

    The eigenvalues are those of M at unit diagonal, so that bad units cost no digits. Negative
    ones, which rounding leaves, are cut off.
    """
    r, V, d = unit_spectrum(M)
    return np.asarray(np.sqrt(np.maximum(r, 0.0))[..., :, None] * np.swapaxes(V, -1, -2) * d)


def unit_spectrum(M: Array) -> tuple[Array, Array, Array]:
    """Eigenvalues r (..., p), ascending, and eigenvectors V of semidefinite M at unit diagonal.

    Returns:
        ``(r, V, d)`` with ``M = D V diag(r) V' D``, D = diag(d) and d (..., 1, p) the roots of the
        diagonal. They are zero where the diagonal is: eigenvectors of the other parameters have
        roundings there, which any other scale would bring in, in whatever units it is.
    """
    d = np.sqrt(np.maximum(np.diagonal(M, axis1=-2, axis2=-1), 0.0))[..., None, :]
    scale = unit_scale(np.square(d))
    r, V = eigenpairs(M / scale / np.swapaxes(scale, -1, -2))
    return r, V, d


def unit_scale(diagonal: Array) -> Array:
    """The roots (..., p) of a diagonal, by which a matrix gets a unit diagonal.

    Where an entry is not positive, the scale is the largest one, or one where none is: it must be
    divided by, and all scales grow with the matrix, so that its units decide nothing.
    """
    size = np.sqrt(np.maximum(diagonal, 0.0))
    largest = size.max(axis=-1, keepdims=True, initial=0.0)
    return np.where(size > 0, size, np.where(largest > 0, largest, 1.0))


def full_rank_root(W: ArrayLike) -> Array:
    """K (p, r) of full column rank with ``K K' = W``, for a positive semidefinite W (p, p).

    A Cholesky factorization whose pivot is the largest remaining entry of the diagonal. So each
    column is dominated by its pivot: the columns are independent in any units of the parameters.

    Raises:
        ValueError: W is not square, finite, symmetric and positive semidefinite, or is zero.
    """
    found = np.array(W, dtype=float)
    if found.ndim != 2 or found.shape[0] != found.shape[1] or not np.isfinite(found).all():
        raise ValueError("expected a finite square matrix (p, p)")
    own = np.diag(found)
    d = unit_scale(own)
    scaled = found / np.outer(d, d)
    if np.abs(scaled - scaled.T).max() > NEGATIVE:
        raise ValueError("expected a symmetric matrix")
    if np.linalg.eigvalsh(scaled).min() < -NEGATIVE:
        raise ValueError("expected a positive semidefinite matrix")
    remaining = 0.5 * (scaled + scaled.T)
    columns: list[Array] = []
    for _ in range(len(found)):
        share = np.diag(remaining)
        left = np.where(share > len(found) * ROUNDING, share * own, 0.0)
        if not left.any():
            break
        pivot = int(left.argmax())
        column = remaining[:, pivot] / np.sqrt(share[pivot])
        remaining = remaining - np.outer(column, column)
        remaining[pivot] = 0.0
        remaining[:, pivot] = 0.0
        columns.append(column * d)
    if not columns:
        raise ValueError("expected a matrix that is not zero")
    return np.stack(columns, axis=1)


def rounding_of_rows(rows: Array, W: Array) -> Array:
    """Bound the relative error of ``sum_j |a_j W|^2`` where products of a_j and W cancel.

    A product of p terms is wrong by ``p eps`` times the sum of their sizes; with ``|w_i|`` the
    length of a row of W, ``|a_j W|`` is wrong by ``p eps sum_i |a_ji| |w_i|`` at most.

    Args:
        rows: Rows a_j (..., k, p) of one sum, or of many.
        W: Matrix (p, r), such as a root of a covariance.

    Returns:
        The bounds (...); zero for a sum that is zero.
    """
    # The units of both do not matter; squares in far ones are no doubles.
    largest = np.abs(rows).max(axis=(-2, -1), initial=0.0, keepdims=True)
    rows = rows / np.where(largest > 0, largest, 1.0)
    W = W / (np.abs(W).max(initial=0.0) or 1.0)
    lengths = np.linalg.norm(rows @ W, axis=-1)
    sizes = np.abs(rows) @ np.linalg.norm(W, axis=1)
    total = np.square(lengths).sum(axis=-1)
    lost = 2 * rows.shape[-1] * EPS * (lengths * sizes).sum(axis=-1)
    return np.divide(lost, total, out=np.zeros_like(total), where=total > 0)
