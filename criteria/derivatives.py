"""Second derivatives of a criterion's cost, as differences of its analytic gradient."""

from functools import cache

import numpy as np

from criteria.criterion import Criterion
from criteria.linalg.root import unit_scale
from criteria.linalg.triangle import triangle
from criteria.linalg.typing import Array

# Of an entry of M, in parts of the root of the product of its two diagonal entries. A one-sided
# difference errs by the step (truncation) and by eps/step (rounding), here 1e-6 and 2e-10.
STEP = 1e-6


@cache
def _entries(p: int) -> Array:
    """Symmetric matrices (1 + q, p, p): zero, then ones at each place of the triangle."""
    i, j = triangle(p)
    E = np.zeros((1 + len(i), p, p))
    k = np.arange(1, 1 + len(i))
    E[k, i, j] = 1.0
    E[k, j, i] = 1.0
    return E


def derivatives(criterion: Criterion, M: Array) -> tuple[Array, Array, Array]:
    """Cost, gradient, and second derivative by the entries of the upper triangle.

    With dM given by its triangle v (q,), row by row, q = p (p + 1)/2, the cost is
    ``f + <G, dM> + v' K v / 2`` up to third order. One call evaluates all differences of all
    matrices; the inverse changes by ``-cov (dM - dM cov dM) cov``, to the same order.

    Args:
        criterion: A criterion that is smooth near M.
        M: Information matrices (b, p, p).

    Returns:
        Costs f (b,), gradients G (b, p, p) and K (b, q, q); inf, nan and nan where M is singular.
    """
    i, j = triangle(M.shape[-1])
    safe, cov, regular = criterion.inverse(M)
    # Steps follow the diagonal of M, so that parameters may have any units.
    d = unit_scale(np.diagonal(safe, axis1=1, axis2=2))
    dM = STEP * (d[:, :, None] * d[:, None])[:, None] * _entries(M.shape[-1])
    C = np.broadcast_to(cov[:, None], dM.shape)
    change = dM @ C
    G = criterion.gradient_of_regular(safe[:, None] + dM, C - C @ (change - change @ change))
    difference = G[:, 1:, i, j] - G[:, :1, i, j]
    # An entry off the diagonal stands for two entries of M.
    weight = np.where(i == j, 1.0, 2.0)
    K = difference * weight / (STEP * d[:, i] * d[:, j])[..., None]
    cost = np.where(regular, criterion.cost_of_regular(safe, cov), np.inf)
    nan = np.where(regular, 0.0, np.nan)[:, None, None]
    return cost, G[:, 0] + nan, 0.5 * (K + np.swapaxes(K, 1, 2)) + nan
