"""Symmetric matrices as columns: the upper triangle, row by row, candidates last.

A million 5 x 5 information matrices are then one (15, 10^6) array, and pricing them all is one matrix product.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from criteria.linalg.triangle import triangle

Array = NDArray[np.float64]


def order(length: int) -> int:
    """The p for which ``p (p + 1)/2`` entries make a packed matrix.

    Raises:
        ValueError: There is none.
    """
    p = int((np.sqrt(8 * length + 1) - 1) / 2)
    if p < 1 or p * (p + 1) // 2 != length:
        raise ValueError(f"{length} entries are not the upper triangle of a square matrix")
    return p


def pack_gram(A: Array) -> Array:
    """``A' A`` packed (p(p+1)/2, ...) of regressors A (p, rows, ...), component first."""
    p = len(A)
    packed = np.empty((p * (p + 1) // 2, *A.shape[2:]))
    for k, (i, j) in enumerate(zip(*triangle(p), strict=True)):
        out = packed[k, ...]
        np.multiply(A[i, 0], A[j, 0], out=out)
        for r in range(1, A.shape[1]):
            out += A[i, r] * A[j, r]
    return packed


def unpack(packed: Array) -> Array:
    """Symmetric matrices (..., p, p) of packed columns (p(p+1)/2, ...)."""
    p = order(len(packed))
    rows, columns = triangle(p)
    M = np.empty((*packed.shape[1:], p, p))
    M[..., rows, columns] = M[..., columns, rows] = packed.transpose(*range(1, packed.ndim), 0)
    return M


def sensitivity_rows(Z: ArrayLike) -> Array:
    """Rows (..., p(p+1)/2) whose product with packed matrices is ``<Z, M>``: off-diagonal entries count twice."""
    Z = np.asarray(Z, dtype=float)
    rows, columns = triangle(Z.shape[-1])
    return Z[..., rows, columns] * np.where(rows == columns, 1.0, 2.0)
