"""As few support points as a design needs."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from criteria.linalg.triangle import triangle
from edtk.design.packed import order

Array = NDArray[np.float64]


def sparse_weights(packed: Array, weights: Array) -> Array:
    """Weights (k,) of the same design on at most ``p(p+1)/2 + 1`` candidates (Caratheodory).

    The weights that give ``sum w_i M_i = M`` form a polytope, and a vertex of it has no more positive entries than
    there are equations; the dual simplex method ends in one.

    Args:
        packed: Information of the candidates (p(p+1)/2, k).
        weights: Their weights (k,), of sum one.

    Returns:
        Weights (k,), those given where they are few enough or the linear program fails.
    """
    if len(weights) <= len(packed) + 1:
        return weights
    rows, columns = triangle(order(len(packed)))
    d = np.sqrt((packed @ weights)[rows == columns])
    scaled = packed / (d[rows] * d[columns])[:, None]
    A = np.vstack([scaled, np.ones(len(weights))])
    result = linprog(np.zeros(len(weights)), A_eq=A, b_eq=A @ weights, method="highs-ds")
    if result.x is None or not result.x.any():
        return weights
    found = np.maximum(result.x, 0.0)
    return np.asarray(found / found.sum())
