"""A design on as few support points as it needs."""

import numpy as np

from criteria.linalg.triangle import triangle
from edtk.design.packed import order
from edtk.system.typing import Array


def sparse_weights(packed: Array, weights: Array) -> Array:
    """Weights of the same design on at most ``p(p+1)/2 + 1`` candidates (Caratheodory).

    The weights that give ``sum_i w_i M_i = M`` form a polytope. A vertex of it has no more positive
    entries than there are equations, and the dual simplex method ends in a vertex.

    Args:
        packed: Information of the candidates (p(p+1)/2, k), see `edtk.design.packed`.
        weights: Their weights (k,), of sum one.

    Returns:
        Weights (k,). They are the given ones where these are few enough, or where the linear
        program fails.
    """
    if len(weights) <= len(packed) + 1:
        return weights
    from scipy.optimize import linprog

    rows, columns = triangle(order(len(packed)))
    # Equations of order one, whatever the units of the parameters.
    root = np.sqrt((packed @ weights)[rows == columns])
    # A parameter may be known from the prior alone: no candidate then contributes to its equations.
    root = np.where(root > 0, root, 1.0)
    scaled = packed / (root[rows] * root[columns])[:, None]
    A = np.vstack([scaled, np.ones(len(weights))])
    result = linprog(np.zeros(len(weights)), A_eq=A, b_eq=A @ weights, method="highs-ds")
    if result.x is None or not result.x.any():
        return weights
    found = np.maximum(result.x, 0.0)
    return np.asarray(found / found.sum())
