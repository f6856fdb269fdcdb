"""Names of the arrays that criteria take and give, and the order of packed triangles."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]


@cache
def triangle(p: int) -> tuple[Indices, Indices]:
    """Rows and columns (q,) of the upper triangle of a (p, p) matrix, row by row.

    The triangle has ``q = p (p + 1)/2`` entries.
    """
    return np.triu_indices(p)


@cache
def isometric(p: int) -> Array:
    """Factors (q,) that make inner products of packed triangles those of the symmetric matrices."""
    rows, columns = triangle(p)
    return np.where(rows == columns, 1.0, np.sqrt(2.0))
