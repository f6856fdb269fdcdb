"""Logarithms of determinants of small matrices."""

import numpy as np

from criteria.linalg.typing import Array

WRITTEN_OUT = 3  # order up to which the sum of products is several times as fast as a factorization


def log_determinant(M: Array) -> Array:
    """``log det M`` (...) of positive definite matrices (..., n, n), for n up to 3 written out.

    Written out, a determinant loses digits where M is near singular; use it for ``I + P`` with a
    positive semidefinite P, as of the determinant lemma.
    """
    n = M.shape[-1]
    if n > WRITTEN_OUT:
        return np.asarray(np.linalg.slogdet(M).logabsdet)
    if n == 1:
        return np.asarray(np.log(M[..., 0, 0]))
    a = M[..., 0, 0]
    b = M[..., 0, 1]
    d = M[..., 1, 1]
    if n == WRITTEN_OUT - 1:
        return np.asarray(np.log(a * d - b * b))
    c = M[..., 0, 2]
    e = M[..., 1, 2]
    f = M[..., 2, 2]
    return np.asarray(np.log(a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d)))
