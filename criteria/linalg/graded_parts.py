"""A symmetric matrix of graded entries as a difference of two semidefinite ones."""

import numpy as np

from criteria.linalg.typing import Array

# Eigenvalues of a (p, p) matrix of size one are known to a small multiple of p eps.
ROUNDING = 16 * np.finfo(float).eps
# Parameters are eliminated whose entries are so many times (its square) the negative part: far
# enough to be hardly mixed with it, and near enough to leave digits of the rest.
FAR = 1e4


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
    s, V = np.linalg.eigh(S)
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
