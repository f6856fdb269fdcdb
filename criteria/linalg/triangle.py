"""The upper triangle of a symmetric matrix, in the order in which its entries are packed."""

from functools import cache

import numpy as np

from criteria.linalg.typing import Indices


@cache
def triangle(p: int) -> tuple[Indices, Indices]:
    """Rows and columns (q,) of the upper triangle of a (p, p) matrix, row by row.

    The triangle has ``q = p (p + 1)/2`` entries.
    """
    return np.triu_indices(p)
