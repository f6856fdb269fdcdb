"""Eigenvalues and singular values: to all digits, in parts, and in cvxpy's constraints."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.linalg.inverse import EPS, NEGATIVE, ROUNDING, eigenpairs, root, unit_scale
from criteria.linalg.typing import Array, Mask

if TYPE_CHECKING:
    import cvxpy as cp

# Ratio of the roots of diagonal entries from which on a matrix is graded: the square of it is lost
# in its eigenvalues.
GRADED = 1e3
# Parameters are eliminated whose entries are so many times (its square) the negative part: far
# enough to be hardly mixed with it, and near enough to leave digits of the rest.
FAR = 1e4
SWEEPS = 30  # a dozen are the rule
# Multiple of ``p eps`` of their lengths up to which a product of columns is zero.
ROUNDINGS_OF_ZERO = 4.0


def conjugate(V: Array, d: Array) -> Array:
    """``V diag(d) V'`` (..., p, p) of V (..., p, p) and d (..., p)."""
    return (V * d[..., None, :]) @ np.swapaxes(V, -1, -2)


def extreme_eigenvalues(T: Array) -> tuple[float, float]:
    """Least and largest eigenvalue of the information that T whitens, ``(T T')^-1``."""
    # In uneven units the least singular value is a rounding of the largest, and that of the inverse
    # is a largest one.
    return float(np.linalg.norm(T, 2) ** -2), float(np.linalg.norm(np.linalg.inv(T), 2) ** 2)


def sharp_variances(cov: Array) -> Array:
    """Eigenvalues (..., p) of covariances (..., p, p) whose roots are right beside the largest.

    Eigenvalues of a graded matrix are known beside the largest of all, and roots of the small ones
    to half the digits. The singular values of a root, formed at unit diagonal, are these roots.
    """
    found = np.linalg.eigvalsh(cov)
    d = np.sqrt(np.diagonal(cov, axis1=-2, axis2=-1))
    graded = d.max(axis=-1) > GRADED * d.min(axis=-1)
    if graded.any():
        found[graded] = np.square(np.linalg.svd(root(cov[graded]), compute_uv=False)[..., ::-1])
    return np.maximum(found, 0.0)


def definite_parts(Z: Array) -> Array:
    """``trace(Z+)`` and ``trace(Z-)`` (2, ...) of ``Z = Z+ - Z-`` (..., p, p), safe for bounds.

    A bound must not profit from rounding: the positive part is lowered, and the negative part is
    raised, by what rounding may have changed. So a bound on ``trace(Z+)/trace(Z-)`` is lowered by
    the part ``16 p eps`` times itself. Only a Z that is positive semidefinite after scaling to a
    unit diagonal has no negative part.

    Where the entries of Z are graded, and the negative part is beside its small ones, the parts are
    not those of the eigenvalues, but of `graded_parts`.
    """
    z = np.linalg.eigvalsh(Z)
    p = z.shape[-1]
    lost = ROUNDING * p * np.abs(z).max(axis=-1)
    positive = np.maximum(z, 0.0).sum(axis=-1)
    negative = -np.minimum(z, 0.0).sum(axis=-1)
    d = unit_scale(np.abs(np.diagonal(Z, axis1=-2, axis2=-1)))
    # In bad units an eigenvalue far below `lost` can be negative in truth; scaling shows it.
    least = np.linalg.eigvalsh(Z / (d[..., :, None] * d[..., None, :]))[..., 0]
    is_semidefinite = least >= -ROUNDING * p
    above = np.maximum(positive - lost, 0.0)
    below = np.where(is_semidefinite, 0.0, negative + lost)
    parts = np.stack([above, below])
    graded = ~is_semidefinite & (d.max(axis=-1) > GRADED * d.min(axis=-1))
    for i in np.argwhere(graded):
        found = graded_parts(Z[tuple(i)])
        if found is not None and found[1] < parts[(1, *i)]:
            parts[(slice(None), *i)] = found
    return parts


def bounded_below(M: "cp.Expression", T: Array) -> "cp.Constraint":
    """``T^-T M T^-1 >= l I`` as ``M >= l T'T``, l the least eigenvalue of what T whitens."""
    return M >> extreme_eigenvalues(T)[0] * (T.T @ T)


def largest_eigenvalue(M: "cp.Expression", T: Array) -> "cp.Expression":
    """Largest eigenvalue of ``T^-T M T^-1``, divided by that of what T whitens."""
    import cvxpy as cp

    S = np.linalg.inv(T) / np.sqrt(extreme_eigenvalues(T)[1])
    X = S.T @ M @ S  # symmetric, which cvxpy cannot tell
    return cp.lambda_max(0.5 * (X + X.T))


def is_semidefinite(Z: Array) -> Mask:
    """Which symmetric matrices (..., p, p) have no negative eigenvalue but rounding; nan has.

    Eigenvalues are those at unit diagonal, which do not depend on the units of the parameters.
    """
    return np.asarray(least_scaled_eigenvalue(Z) >= -NEGATIVE * Z.shape[-1])


def least_scaled_eigenvalue(Z: Array) -> Array:
    """Least eigenvalue (...) of symmetric matrices (..., p, p) at unit diagonal; nan is -inf."""
    finite = np.asarray(np.isfinite(Z).all(axis=(-2, -1)))
    safe = np.where(finite[..., None, None], Z, 0.0)
    d = unit_scale(np.abs(np.diagonal(safe, axis1=-2, axis2=-1)))
    least = np.linalg.eigvalsh(safe / d[..., :, None] / d[..., None, :])[..., 0]
    return np.asarray(np.where(finite, least, -np.inf))


def graded_parts(Z: Array) -> Array | None:
    """``trace(Z+)`` and ``trace(Z-)`` (2,) of some ``Z = Z+ - Z-``, whose Z- is nearly the least.

    Eigenvalues have the rounding of the largest one, beside which the negative part of a graded Z
    may be lost. So Z- is only guessed from them, and Z+ is proved to be semidefinite by Cholesky's
    factors in a scaling to unit diagonal, where rounding is below ``16 p eps`` of each entry. A
    diagonal that is lowered by as much makes Z+ semidefinite in spite of it.

    1. With ``Z = (A B; B' C)`` and A the block of the largest entries, Z plus Z- in the other block
       is semidefinite if A is positive definite and ``S + Z-`` semidefinite, for the Schur
       complement ``S = C - B'A^-1 B``. The same is done with S, until none are much larger.
    2. Let Q be the eigenvectors of S with eigenvalues that may be negative. Then ``S + Q X Q'`` is
       semidefinite if ``-X`` is at most the Schur complement in the basis (N, E), where ``Q'N = 0``
       and ``Q'E = I``. With rows ``Q = (Q_1; Q_2)`` and ``G = Q_1 Q_2^-1``, that is
       ``N = (I; -G')`` and ``E = (0; Q_2^-T)``, whose entries are graded like those of Z.

    Args:
        Z: Symmetric matrix (p, p).

    Returns:
        The traces; None where the large entries are not positive definite.
    """
    p = len(Z)
    d = np.sqrt(np.abs(np.diag(Z)))
    if not d.min() > 0:
        return None
    order = np.argsort(-d)
    d = d[order]
    S = Z[np.ix_(order, order)] / np.outer(d, d)
    left = d
    while True:
        size = _negative_size(S * np.outer(left, left))
        k = int((left > FAR * size).sum())
        if not 0 < k < len(left):
            break
        found = _schur_complement(S, k)
        if found is None:
            return None
        S = found
        left = left[k:]
    below = _negative_trace(S, left)
    rounding = ROUNDING * p * float(np.abs(np.diag(Z)).max())
    return np.array([max(float(np.trace(Z)) + below - rounding, 0.0), below])


def _schur_complement(scaled: Array, k: int) -> Array | None:
    """That of the first k parameters of a lowered matrix; None unless they are definite."""
    lowered = scaled - ROUNDING * len(scaled) * np.eye(len(scaled))
    try:
        L = np.linalg.cholesky(lowered[:k, :k])
    except np.linalg.LinAlgError:
        return None
    X = np.linalg.solve(L, lowered[:k, k:])
    return np.asarray(lowered[k:, k:] - X.T @ X)


def _negative_size(S: Array) -> float:
    """Root of the largest size that a negative eigenvalue of S (q, q) may have."""
    s = np.linalg.eigvalsh(S)
    return float(np.sqrt(max(-s[0], ROUNDING * len(S) * np.abs(s).max())))


def _negative_trace(scaled: Array, d: Array) -> float:
    """The trace of a Z- that makes a matrix semidefinite, see step 2 of `graded_parts`.

    Args:
        scaled: The matrix (q, q), scaled by d.
        d: Scales (q,).
    """
    S = scaled * np.outer(d, d)
    s, V = eigenpairs(S)
    lost = ROUNDING * len(S) * float(np.abs(s).max())
    simple = float(-np.minimum(s, 0.0).sum()) + lost
    m = int((s < lost).sum())
    if m == len(S):
        return simple
    Q = V[:, :m]
    last = _independent_rows(Q)
    first = np.setdiff1d(np.arange(len(S)), last)
    # In the scaled parameters, where a combination q is q d.
    inverse = np.linalg.inv(Q[last])
    G = Q[first] @ inverse * (d[last] / d[first][:, None])
    A = scaled[np.ix_(first, first)]
    B = scaled[np.ix_(first, last)]
    C = scaled[np.ix_(last, last)]
    own = A - G @ B.T - B @ G.T + G @ C @ G.T
    lowered = np.vstack([np.hstack([own, B - G @ C]), np.hstack([(B - G @ C).T, C])])
    found = _schur_complement(lowered, len(first))
    if found is None:
        return simple
    E = inverse * d[last]
    x = np.linalg.eigvalsh(E @ found @ E.T)
    length = float(np.linalg.norm(Q.T @ Q, 2))
    below = -np.minimum(x, 0.0).sum() + ROUNDING * len(S) * np.abs(x).max()
    return min(float(below) * length, simple)


def _independent_rows(Q: Array) -> Array:
    """Indices (m,) of rows of Q (q, m) that span its range, each the farthest from those before."""
    rest = Q.copy()
    chosen: list[int] = []
    for _ in range(Q.shape[1]):
        best = int(np.square(rest).sum(axis=1).argmax())
        chosen.append(best)
        along = rest[best] / np.linalg.norm(rest[best])
        rest = rest - np.outer(rest @ along, along)
    return np.array(sorted(chosen))


def orthogonal_columns(T: Array) -> Array:
    """``T J`` with orthogonal columns, for an orthogonal J: by one-sided Jacobi rotations.

    The lengths of the columns are the singular values of T. Each pair of columns is turned until
    their product is a rounding beside their own lengths, not beside the longest of all. So short
    columns keep their digits, however long the others are, where a bidiagonalization leaves a
    rounding of the longest (Demmel and Veselic, SIAM J. Matrix Anal. Appl. 13, 1992).

    Args:
        T: Regular matrix (p, p), best with its longest columns first.
    """
    p = T.shape[1]
    T = np.array(T, dtype=float)
    if p < 2:
        return T
    least = ROUNDINGS_OF_ZERO * p * EPS
    for _ in range(SWEEPS):
        most = 0.0
        for first, second in _pairs(p):
            most = max(most, _turn(T, first, second))
        if most <= least:
            break
    return T


def have_orthogonal_columns(T: Array) -> bool:
    """Whether the columns of T (p, p) are orthogonal but for rounding, whatever their lengths."""
    lengths = np.linalg.norm(T, axis=0)
    if not (lengths > 0).all():
        return False
    unit = T / lengths
    p = T.shape[1]
    return bool(np.abs(unit.T @ unit - np.eye(p)).max() <= 4 * ROUNDINGS_OF_ZERO * p * EPS)


def _pairs(p: int) -> list[tuple[Array, Array]]:
    """Rounds in which each pair of p columns meets once, as players of a tournament do."""
    players = list(range(p + p % 2))
    half = len(players) // 2
    rounds = []
    for _ in range(len(players) - 1):
        pairs = [
            sorted(pair)
            for pair in zip(players[:half], reversed(players[half:]), strict=True)
            if max(pair) < p
        ]
        first, second = np.array(pairs, dtype=int).T
        rounds.append((first, second))
        players = [players[0], players[-1], *players[1:-1]]
    return rounds


def _turn(T: Array, first: Array, second: Array) -> float:
    """Turn pairs of columns of T, in place, until each pair is orthogonal.

    Returns:
        The largest cosine of a pair before.
    """
    x = T[:, first]
    y = T[:, second]
    a = np.einsum("ij,ij->j", x, x)
    b = np.einsum("ij,ij->j", y, y)
    c = np.einsum("ij,ij->j", x, y)
    # The product of two large squares may be no double where each of them is one.
    cosine = np.abs(c) / (np.sqrt(a) * np.sqrt(b))
    turned = cosine > EPS
    zeta = (b - a) / (2 * np.where(turned, c, 1.0))
    # The smaller of the two angles, as a tangent: the long column stays the long one.
    sign = np.where(zeta >= 0, 1.0, -1.0)
    t = np.where(turned, sign / (np.abs(zeta) + np.hypot(1.0, zeta)), 0.0)
    cos = 1.0 / np.hypot(1.0, t)
    T[:, first] = cos * x - cos * t * y
    T[:, second] = cos * t * x + cos * y
    return float(cosine.max())
