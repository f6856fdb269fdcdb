"""A root of a weight matrix, with as many columns as the matrix has rank."""

import numpy as np
from numpy.typing import ArrayLike

from criteria.linalg.inverse import ROUNDING
from criteria.linalg.root import unit_scale
from criteria.linalg.typing import Array

# Negative part of a weight matrix, at unit diagonal, that counts as rounding of whoever made it:
# sums of a million squares lose ten digits at most.
NEGATIVE = 1e-10


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
