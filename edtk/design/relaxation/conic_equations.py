"""The linear equations of a step of an interior point method for semidefinite programs."""

from collections.abc import Callable

import numpy as np

from edtk.design.relaxation.weight_equations import weight_equations
from edtk.system.typing import Array

# Size of the other term at which six digits of the identity are left.
LOST = 1e10
ConicSolve = Callable[[Array, Array, float], tuple[Array, float, Array]]


def conic_equations(P: Array, D: Array, last: Array | None) -> ConicSolve:
    """Prepare the equations of weights x, a free number z and packed duals y:

        y + P x + l z = c,    D x - P' y = d,    l' y = u.

    Without duals they are those of `weight_equations`. Where there are more weights than rows, the
    weights are eliminated instead, ``(I + P D^-1 P') y + l z = c - P D^-1 d``, as long as the
    identity is not lost in rounding beside the other term.

    Args:
        P: Matrix (q, k).
        D: Positive numbers (k,).
        last: The vector l (q,); None where there is no z.

    Returns:
        A function from c (q,), d (k,) and u to x (k,), z and y (q,).

    Raises:
        LinAlgError: A matrix is not positive definite to working precision.
    """
    if P.shape[1] > len(P):
        scaled = P / np.sqrt(D)
        if np.einsum("qk,qk->", scaled, scaled) < LOST:
            return _by_duals(P, scaled, D, last)
    return _by_weights(P, D, last)


def _by_weights(P: Array, D: Array, last: Array | None) -> ConicSolve:
    """By the equations of the weights, of which z is one more that may have any sign."""
    whole = P
    if last is not None:
        whole = np.column_stack([P, last])
        D = np.append(D, 0.0)
    few = weight_equations(whole, D, most=np.inf)

    def solve(c: Array, d: Array, u: float) -> tuple[Array, float, Array]:
        right = whole.T @ c
        k = P.shape[1]
        right[:k] += d
        right[k:] -= u
        found = few(right)
        return found[:k], float(found[k:].sum()), c - whole @ found

    return solve


def _by_duals(P: Array, scaled: Array, D: Array, last: Array | None) -> ConicSolve:
    """By the equations of the duals."""
    from scipy.linalg import cho_factor, cho_solve

    S = scaled @ scaled.T
    S[np.diag_indices_from(S)] += 1.0
    factor = cho_factor(S, lower=True, overwrite_a=True, check_finite=False)
    along = None if last is None else cho_solve(factor, last, check_finite=False)

    def solve(c: Array, d: Array, u: float) -> tuple[Array, float, Array]:
        y = cho_solve(factor, c - P @ (d / D), check_finite=False)
        z = 0.0
        if last is not None and along is not None:
            z = float((last @ y - u) / (last @ along))
            y = y - z * along
        return (d + P.T @ y) / D, z, y

    return solve
