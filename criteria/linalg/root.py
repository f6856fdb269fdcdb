"""Roots of positive semidefinite matrices: computing with them costs half as many digits."""

import numpy as np

from criteria.linalg.typing import Array


def root(M: Array) -> Array:
    """F (..., p, p) with ``F'F = M`` of positive semidefinite M (..., p, p), also singular.

    The eigenvalues are those of M at unit diagonal, so that bad units cost no digits. Negative
    ones, which rounding leaves, are cut off.
    """
    r, V, d = unit_spectrum(M)
    return np.asarray(np.sqrt(np.maximum(r, 0.0))[..., :, None] * np.swapaxes(V, -1, -2) * d)


def unit_spectrum(M: Array) -> tuple[Array, Array, Array]:
    """Eigenvalues r (..., p), ascending, and eigenvectors V of semidefinite M at unit diagonal.

    Returns:
        ``(r, V, d)`` with ``M = D V diag(r) V' D``, D = diag(d) and d (..., 1, p) the roots of the
        diagonal. They are zero where the diagonal is: eigenvectors of the other parameters have
        roundings there, which any other scale would bring in, in whatever units it is.
    """
    d = np.sqrt(np.maximum(np.diagonal(M, axis1=-2, axis2=-1), 0.0))[..., None, :]
    scale = unit_scale(np.square(d))
    r, V = np.linalg.eigh(M / scale / np.swapaxes(scale, -1, -2))
    return r, V, d


def unit_scale(diagonal: Array) -> Array:
    """The roots (..., p) of a diagonal, by which a matrix gets a unit diagonal.

    Where an entry is not positive, the scale is the largest one, or one where none is: it must be
    divided by, and all scales grow with the matrix, so that its units decide nothing.
    """
    size = np.sqrt(np.maximum(diagonal, 0.0))
    largest = size.max(axis=-1, keepdims=True, initial=0.0)
    return np.where(size > 0, size, np.where(largest > 0, largest, 1.0))
