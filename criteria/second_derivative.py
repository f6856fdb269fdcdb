"""Second derivatives of a criterion's cost, as differences of its analytic gradient."""

import numpy as np
from numpy.typing import NDArray

from criteria.criterion import Criterion

Array = NDArray[np.float64]
STEP = 1e-6  # of an entry of M, in parts of the root of the product of its two diagonal entries


def derivatives(criterion: Criterion, M: Array) -> tuple[Array, Array, Array]:
    """Cost, gradient, and second derivative by the entries of the upper triangle.

    With dM given by its triangle v (q,), row by row, q = p (p + 1)/2, the cost is ``f + <G, dM> + v' K v / 2`` up to
    third order. All differences of all matrices are taken in one call.

    Args:
        criterion: The criterion, smooth near M.
        M: Information matrices (b, p, p).

    Returns:
        Costs f (b,), gradients G (b, p, p) and K (b, q, q); inf, nan and nan where M is singular.
    """
    i, j = np.triu_indices(M.shape[-1])
    k = np.arange(len(i))
    d = np.sqrt(np.diagonal(M, axis1=1, axis2=2))
    step = STEP * d[:, i] * d[:, j]
    around = np.repeat(M[:, None], 1 + len(k), axis=1)
    around[:, 1 + k, i, j] += step
    around[:, 1 + k, j, i] = around[:, 1 + k, i, j]
    cost, G = criterion.cost_and_gradient(around)
    with np.errstate(invalid="ignore"):
        K = (G[:, 1:, i, j] - G[:, :1, i, j]) * np.where(i == j, 1.0, 2.0) / step[..., None]
    return cost[:, 0], G[:, 0], 0.5 * (K + np.swapaxes(K, 1, 2))
