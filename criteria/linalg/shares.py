"""Shares of semidefinite matrices: with a sum near another one, or of the largest polar."""

import numpy as np

from criteria.linalg.inverse import TINY, eigenpairs
from criteria.linalg.typing import Array, isometric, triangle

WEIGHT_STEPS = 20  # towards the best weights of variances or of tasks; any weights prove a bound


def least_squares_shares(G: Array, Z: Array, penalty: Array, unit: float = 1.0) -> Array:
    """Shares (k,) of sum one with ``sum u_j G_j`` near a multiple of Z; zeros if there are none.

    Args:
        G: Symmetric matrices (k, s, s).
        Z: A semidefinite matrix (s, s).
        penalty: What each share costs (k,), from zero on.
        unit: Size of the matrices, by which they are divided.
    """
    from scipy.optimize import nnls

    rows, columns = triangle(Z.shape[-1])
    length = isometric(Z.shape[-1])
    A = np.vstack([(G[:, rows, columns] * length).T / unit, penalty])
    b = np.append(Z[rows, columns] * length / max(float(np.trace(Z)), TINY), 0.0)
    try:
        shares, _ = nnls(A, b)
    except RuntimeError:  # too many iterations: the other choice remains
        shares = np.zeros(len(G))
    total = shares.sum()
    return np.asarray(shares / total if total > 0 else shares)


def steps_to_largest_polar(squares: Array, Z: Array, weights: Array) -> list[Array]:
    """Weights (d,) of sum one, step by step towards those of the largest polar, all whitened."""
    found = []
    z, V = eigenpairs(Z)
    root = (V * np.sqrt(np.maximum(z, 0.0))) @ V.T
    turned = root @ squares @ root
    for _ in range(WEIGHT_STEPS):
        if not weights.sum() > 0:
            break
        found.append(weights)
        values, U = eigenpairs(np.tensordot(weights, turned, axes=1))
        # The gradient is K^(-1/2)/2; where K has no part, no task that has weight has one either.
        inverse = np.where(values > 1e-12 * values[-1], np.maximum(values, TINY) ** -0.5, 0.0)
        gains = np.tensordot(turned, (U * inverse) @ U.T, axes=2)
        weights = weights * np.maximum(gains, 0.0)  # rounding may leave less than none
        total = weights.sum()
        weights = weights / total if total > 0 else weights
    return found
