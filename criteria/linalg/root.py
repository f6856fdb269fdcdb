"""Roots of positive semidefinite matrices: computing with them costs half as many digits."""

import numpy as np

from criteria.linalg.typing import Array


def root(M: Array) -> Array:
    """F (p, p) with ``F'F = M`` of a positive semidefinite M (p, p), singular ones included.

    The eigenvalues are those of M at unit diagonal, so that bad units cost no digits. Negative
    ones, which rounding leaves, are cut off.
    """
    d = np.sqrt(np.maximum(np.diag(M), 0.0))
    d = np.where(d > 0, d, 1.0)
    r, V = np.linalg.eigh(M / np.outer(d, d))
    return np.asarray(np.sqrt(np.maximum(r, 0.0))[:, None] * V.T * d)
