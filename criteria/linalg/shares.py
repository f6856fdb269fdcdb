"""Shares of matrices whose sum comes near another one."""

import numpy as np

from criteria.linalg.inverse import TINY
from criteria.linalg.typing import Array, isometric, triangle


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
