"""A design on as few support points as it needs."""

import numpy as np

from criteria.linalg.triangle import triangle
from edtk.design.packed import order
from edtk.system.typing import Array

# Equations up to which null vectors are found one by one; the linear program of more is quicker.
FEW = 60


def sparse_weights(packed: Array, weights: Array) -> Array:
    """Weights of the same design on at most ``p(p+1)/2 + 1`` candidates (Caratheodory).

    The weights that give ``sum_i w_i M_i = M`` form a polytope. A vertex of it has no more positive
    entries than there are equations. Where these are few, the weights go from face to face along
    null vectors of the equations; the dual simplex method ends in a vertex too.

    Args:
        packed: Information of the candidates (p(p+1)/2, k), see `edtk.design.packed`.
        weights: Their weights (k,), of sum one.

    Returns:
        Weights (k,). They are the given ones where these are few enough, or where the linear
        program fails.
    """
    if len(weights) <= len(packed) + 1:
        return weights
    rows, columns = triangle(order(len(packed)))
    # Equations of order one, whatever the units of the parameters.
    root = np.sqrt((packed @ weights)[rows == columns])
    # A parameter may be known from the prior alone: no candidate then contributes to its equations.
    root = np.where(root > 0, root, 1.0)
    scaled = packed / (root[rows] * root[columns])[:, None]
    A = np.vstack([scaled, np.ones(len(weights))])
    if len(A) <= FEW:
        return _by_null_vectors(A, weights)
    from scipy.optimize import linprog

    result = linprog(np.zeros(len(weights)), A_eq=A, b_eq=A @ weights, method="highs-ds")
    if result.x is None or not result.x.any():
        return weights
    found = np.maximum(result.x, 0.0)
    return np.asarray(found / found.sum())


def _by_null_vectors(A: Array, weights: Array) -> Array:
    """Weights (k,) with the same ``A w``, for A (q, k), of which at most q are positive.

    Of any q + 1 columns some combination is zero. The weights move along it until the first of them
    is gone; the heaviest candidates are the last to join, and rarely go.
    """
    w = weights.copy()
    inside: list[int] = []
    for column in np.argsort(w, kind="stable"):
        inside.append(int(column))
        if len(inside) <= len(A):
            continue
        along = np.linalg.svd(A[:, inside])[2][-1]
        # Of both directions the one that ends at the lightest weight.
        reach = w[inside] / np.maximum(np.abs(along), np.finfo(float).tiny)
        first = int(reach.argmin())
        w[inside] -= w[inside[first]] / along[first] * along
        w[inside[first]] = 0.0
        inside = [i for i in inside if w[i] > 0]
    w = np.maximum(w, 0.0)
    return np.asarray(w / w.sum())
