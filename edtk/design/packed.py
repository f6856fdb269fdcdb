"""Packed symmetric matrices: the upper triangle, row by row, as columns with candidates last.

A million 5 x 5 information matrices are then one array (15, 10^6), and the sensitivities of all of
them are one matrix product.
"""

import numpy as np
from numpy.typing import ArrayLike

from criteria.linalg.triangle import triangle
from edtk.system.typing import Array


def order(length: int) -> int:
    """Find the order p of the matrix whose upper triangle has ``p (p + 1)/2`` entries.

    Raises:
        ValueError: No upper triangle of a square matrix has this length.
    """
    p = int((np.sqrt(8 * length + 1) - 1) / 2)
    if p < 1 or p * (p + 1) // 2 != length:
        raise ValueError(f"{length} entries are not the upper triangle of a square matrix")
    return p


def pack_gram(A: Array) -> Array:
    """Compute the information ``A' A`` of many regressors at once.

    Args:
        A: Regressors (p, rows, ...), component first.

    Returns:
        Packed matrices (p(p+1)/2, ...).
    """
    p = len(A)
    packed = np.empty((p * (p + 1) // 2, *A.shape[2:]))
    for entry, (i, j) in enumerate(zip(*triangle(p), strict=True)):
        # The products are added in place: a temporary for all rows would be as large as A itself.
        out = packed[entry, ...]
        np.multiply(A[i, 0], A[j, 0], out=out)
        for row in range(1, A.shape[1]):
            out += A[i, row] * A[j, row]
    return packed


def pack(M: Array) -> Array:
    """Pack symmetric matrices (..., p, p) as columns (p(p+1)/2, ...)."""
    rows, columns = triangle(M.shape[-1])
    return np.moveaxis(M[..., rows, columns], -1, 0)


def unpack(packed: Array) -> Array:
    """Restore symmetric matrices (..., p, p) from packed columns (p(p+1)/2, ...)."""
    p = order(len(packed))
    rows, columns = triangle(p)
    entries = packed.transpose(*range(1, packed.ndim), 0)
    M = np.empty((*packed.shape[1:], p, p))
    M[..., rows, columns] = entries
    M[..., columns, rows] = entries
    return M


def sensitivity_rows(Z: ArrayLike) -> Array:
    """Prepare multipliers so that one matrix product gives ``<Z, M>`` of all packed matrices.

    Args:
        Z: Symmetric multipliers (..., p, p).

    Returns:
        Rows (..., p(p+1)/2), in which off-diagonal entries count twice.
    """
    Z = np.asarray(Z, dtype=float)
    rows, columns = triangle(Z.shape[-1])
    return Z[..., rows, columns] * np.where(rows == columns, 1.0, 2.0)
