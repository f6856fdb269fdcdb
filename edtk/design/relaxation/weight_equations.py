"""The linear equations of a Newton step over the weights of candidates."""

from collections.abc import Callable

import numpy as np

from edtk.system.typing import Array

Solve = Callable[[Array], Array]
# How many more candidates than entries of a triangle make the equations of the entries cheaper.
MANY = 1.2
# Largest entry of their equations: rounding of it is then a thousandth of what is asked for.
LARGEST = 1e12
MOST_FEW = 1000  # candidates whose own equations are affordable where it is larger


def weight_equations(P: Array, D: Array, lost: Array | None = None, most: float = MANY) -> Solve:
    """Prepare ``(P'P + diag(D) - l l') x = b`` for several right-hand sides.

    For k candidates and q rows of P, either the (k, k) matrix is factorized, or the (q, q) matrix
    ``I + P D^-1 P'`` of Woodbury's identity, whichever is smaller.

    Args:
        P: Matrix (q, k).
        D: Numbers (k,), at least zero.
        lost: Vector l (k,) of a square that is taken away, after which the matrix must still be
            positive definite; None for none.
        most: Candidates per row of P from which on Woodbury's identity is used, which is less
            accurate.

    Returns:
        A function from b (k,) to x (k,).

    Raises:
        LinAlgError: The matrix is not positive definite to working precision.
    """
    solve = _solver(P, D, most)
    if lost is None:
        return solve
    y = solve(lost)
    rest = 1.0 - lost @ y
    # Rounding may leave nothing of a rest that is positive in truth; then the square is not taken
    # away, which makes the step shorter.
    if rest <= np.finfo(float).eps:
        return solve

    def corrected(b: Array) -> Array:
        return np.asarray(solve(b) + y * (y @ b / rest))

    return corrected


def _solver(P: Array, D: Array, most: float) -> Solve:
    """The solution without the square that is taken away."""
    k = P.shape[1]
    if k <= most * len(P):
        return _few(P, D)
    # Near the optimum D vanishes on the support, and Woodbury's identity is a difference of large
    # numbers.
    lost = k <= MOST_FEW and (P * P / D).sum(axis=1).max() > LARGEST
    return _few(P, D) if lost else _many(P, D)


def _few(P: Array, D: Array) -> Solve:
    """By the matrix of the candidates (k, k)."""
    from scipy.linalg import cho_factor, cho_solve

    H = P.T @ P
    diagonal = np.diag_indices_from(H)
    # Candidates that tell the same make H singular where D vanishes; rounding must not make it
    # indefinite.
    H[diagonal] += D + len(D) * np.finfo(float).eps * H[diagonal]
    factor = cho_factor(H, lower=True, overwrite_a=True, check_finite=False)

    def solve(b: Array) -> Array:
        x = cho_solve(factor, b, check_finite=False)
        # Near the optimum H is ill-conditioned; one refinement saves the last digits of a step.
        return np.asarray(x + cho_solve(factor, b - P.T @ (P @ x) - D * x, check_finite=False))

    return solve


def _many(P: Array, D: Array) -> Solve:
    """By the matrix of the entries (q, q)."""
    from scipy.linalg import cho_factor, cho_solve

    scaled = P / np.sqrt(D)
    K = scaled @ scaled.T
    K[np.diag_indices_from(K)] += 1.0
    factor = cho_factor(K, lower=True, overwrite_a=True, check_finite=False)

    def solve(b: Array) -> Array:
        x = b / D
        return np.asarray(x - (P.T @ cho_solve(factor, P @ x, check_finite=False)) / D)

    return solve
