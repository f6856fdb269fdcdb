"""The upper triangle of a symmetric matrix, in the order in which its entries are packed everywhere."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.intp]


@cache
def triangle(p: int) -> tuple[Indices, Indices]:
    """Rows and columns (q,) of the upper triangle of a (p, p) matrix, row by row; q = p (p + 1)/2."""
    return np.triu_indices(p)
