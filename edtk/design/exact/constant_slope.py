"""Criteria that are a power of a weighted trace of the covariance, such as A, I, c and rho0."""

import numpy as np

from criteria import Criterion
from edtk.system.typing import Array

SAME = 1e-9  # relative difference of two slopes that are the same


def constant_slope(criterion: Criterion, mean: Array) -> Array | None:
    """W (p, p) where the criterion's cost is a power q of ``tr(W cov)``; None for other criteria.

    The trace itself, ``cost^(1/q)`` with the degree q, has the gradient ``-cov W cov``. So minus M
    times that times M is the same at every M, and its product with the covariance is the trace.

    Args:
        criterion: The criterion.
        mean: A regular information matrix (p, p).
    """
    if not criterion.smooth or criterion.degree <= 0:
        return None
    L = np.linalg.cholesky(mean)
    p = len(mean)
    found = []
    for spread in (np.ones(p), np.linspace(1.0, 2.0, p), np.linspace(3.0, 1.0, p) ** 2):
        M = (L * spread) @ L.T
        cost, G = criterion.cost_and_gradient(M)
        trace = float(cost) ** (1.0 / criterion.degree)
        own = -spread[:, None] * (L.T @ G @ L) * spread * trace / (criterion.degree * cost)
        # The trace of the whitened slope with the covariance, which is diagonal here.
        if not abs(float(np.sum(np.diag(own) / spread)) - trace) <= SAME * trace:
            return None
        found.append(own)
    size = np.abs(found[0]).max()
    if not all(np.abs(other - found[0]).max() <= SAME * size for other in found[1:]):
        return None
    return np.asarray(L @ found[0] @ L.T)
