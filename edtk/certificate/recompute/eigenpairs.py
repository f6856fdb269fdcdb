"""Eigenvalues and eigenvectors: by LAPACK, or by Jacobi's rotations in the longest numbers."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from edtk.system.typing import Array

LONG = np.longdouble
Long = NDArray[np.floating[Any]]
LONG_EPS = float(np.finfo(LONG).eps)
SWEEPS = 30  # of rotations; ten are the rule


def eigenpairs(M: Array) -> tuple[Array, Array]:
    """Eigenvalues (..., n), ascending, and eigenvectors (..., n, n) of symmetric M (..., n, n).

    Divide and conquer of LAPACK on rare occasions does not converge for an ordinary matrix of more
    than 25 columns, for which no certificate is to be called unsound: rotations, which are slower,
    find its eigenvalues.

    Raises:
        LinAlgError: M is not finite.
    """
    try:
        r, V = np.linalg.eigh(M)
    except np.linalg.LinAlgError:
        if not np.isfinite(M).all():
            raise
        if M.ndim > 2:
            pairs = [eigenpairs(one) for one in M]
            return np.stack([one for one, _ in pairs]), np.stack([one for _, one in pairs])
        turned = rotations(M.astype(LONG))
        diagonal = np.einsum("ia,ij,ja->a", turned, M, turned)
        order = np.argsort(diagonal)
        r, V = diagonal[order].astype(float), turned[:, order].astype(float)
    return r, V


def rotations(Y: Long) -> Long:
    """V (p, p), orthogonal, with ``V'Y V`` nearly diagonal: Jacobi's rotations, largest first."""
    p = len(Y)
    order = np.argsort(-np.abs(np.diag(Y)), kind="stable")
    A = Y[np.ix_(order, order)]
    V: Long = np.eye(p, dtype=LONG)[:, order]
    for _ in range(SWEEPS):
        turned = False
        for a in range(p - 1):
            for b in range(a + 1, p):
                c = A[a, b]
                if abs(c) <= LONG_EPS * np.sqrt(abs(A[a, a] * A[b, b])):
                    continue
                turned = True
                zeta = (A[b, b] - A[a, a]) / (2 * c)
                tangent = (1 if zeta >= 0 else -1) / (abs(zeta) + np.hypot(LONG(1), zeta))
                cosine = 1 / np.hypot(LONG(1), tangent)
                G = np.array([[cosine, tangent * cosine], [-tangent * cosine, cosine]])
                A[:, [a, b]] = A[:, [a, b]] @ G
                A[[a, b]] = G.T @ A[[a, b]]
                A[a, b] = A[b, a] = 0
                V[:, [a, b]] = V[:, [a, b]] @ G
        if not turned:
            break
    return V
