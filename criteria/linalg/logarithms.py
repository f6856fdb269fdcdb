"""Logarithms of determinants and of variances, and maxima that are smooth."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from criteria.linalg.typing import Array

if TYPE_CHECKING:
    import cvxpy as cp

WRITTEN_OUT = 3  # order up to which the sum of products is several times as fast as a factorization


def log_determinant(M: Array) -> Array:
    """``log det M`` (...) of matrices (..., n, n) with det M > 0, for n up to 3 written out.

    Written out, a determinant loses digits where M is near singular; use it for ``I + P``, as of
    the determinant lemma, with a positive semidefinite P, or where the determinant is not small.
    """
    n = M.shape[-1]
    if n > WRITTEN_OUT:
        return np.asarray(np.linalg.slogdet(M).logabsdet)
    if n == 1:
        return np.asarray(np.log(M[..., 0, 0]))
    a, b = M[..., 0, 0], M[..., 0, 1]
    d, e = M[..., 1, 0], M[..., 1, 1]
    if n == WRITTEN_OUT - 1:
        return np.asarray(np.log(a * e - b * d))
    c, f = M[..., 0, 2], M[..., 1, 2]
    g, h, i = M[..., 2, 0], M[..., 2, 1], M[..., 2, 2]
    return np.asarray(np.log(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)))


def log_of_inverse(
    M: "cp.Expression", B: Array, unit: float
) -> tuple["cp.Expression", list["cp.Constraint"]]:
    """``-log(trace(B M^-1 B') / unit)`` as the log of the largest g with ``g^2 trace <= g unit``.

    Args:
        M: Symmetric (p, p) expression.
        B: Rows (r, p).
        unit: The unit of the trace.
    """
    import cvxpy as cp

    g = cp.Variable(nonneg=True)
    return cp.log(g), [cp.matrix_frac(g * (B.T * unit**-0.5), M) <= g]


def soft_maximum(x: NDArray[np.floating[Any]], sharpness: float) -> tuple[Array, Array]:
    """``f = (sum x_i^s)^(1/s)`` of positive x along the last axis, with its derivatives.

    The derivatives are ``(x_i/f)^(s-1)``, and ``max x <= f <= n^(1/s) max x``. For s = inf, f is
    the maximum itself, and the derivatives are one at a single largest entry and zero elsewhere.

    Args:
        x: Positive numbers (..., n).
        sharpness: s, above one; inf for the maximum.

    Returns:
        f (...) and its derivatives (..., n).
    """
    top = x.max(axis=-1, keepdims=True)
    if np.isinf(sharpness):
        is_first_largest = np.arange(x.shape[-1]) == x.argmax(axis=-1)[..., None]
        return top[..., 0], is_first_largest.astype(float)
    # Divided by the largest, no power overflows, whatever the units of x are.
    ratio = x / top
    total = (ratio**sharpness).sum(axis=-1, keepdims=True) ** (1.0 / sharpness)
    return (top * total)[..., 0], (ratio / total) ** (sharpness - 1.0)
