"""A design on as few support points as it needs."""

import numpy as np

from criteria.linalg.triangle import triangle
from edtk.design.packed import order
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array

# Candidates whose weights move at a time, in parts of the equations: null vectors of more would
# take memory, and those of fewer be searched for anew too often.
AT_ONCE = 2


def sparse_weights(packed: Array, weights: Array) -> Array:
    """Weights of the same design on at most ``p(p+1)/2 + 1`` candidates (Caratheodory).

    The weights that give ``sum_i w_i M_i = M`` form a polytope. A vertex of it has no more positive
    entries than the rank of the equations, which may be far below their number. The weights go from
    face to face along null vectors of the equations, and lose a candidate at each; the heaviest
    candidates are the last to join, and rarely go.

    Args:
        packed: Information of the candidates (p(p+1)/2, k), see `edtk.design.packed`.
        weights: Their weights (k,), of sum one.

    Returns:
        Weights (k,). They are the given ones where these are few enough; on more candidates than
        needed where the time is over.
    """
    if len(weights) <= len(packed) + 1:
        return weights
    A = _equations(packed, weights)
    w = weights.copy()
    inside = np.empty(0, dtype=int)
    waiting = np.argsort(w, kind="stable")
    while len(waiting) and not out_of_time():
        joining = AT_ONCE * len(A) - len(inside)
        inside = np.concatenate([inside, waiting[:joining]])
        waiting = waiting[joining:]
        w[inside] = _vertex(A[:, inside], w[inside])
        inside = inside[w[inside] > 0]
    return np.asarray(w / w.sum())


def _equations(packed: Array, weights: Array) -> Array:
    """Equations (q, k) of a design, of order one whatever the units of the parameters."""
    rows, columns = triangle(order(len(packed)))
    root = np.sqrt((packed @ weights)[rows == columns])
    # A parameter may be known from the prior alone: no candidate then contributes to its equations.
    root = np.where(root > 0, root, 1.0)
    scaled = packed / (root[rows] * root[columns])[:, None]
    return np.vstack([scaled, np.ones(len(weights))])


def _vertex(A: Array, weights: Array) -> Array:
    """Weights (k,) of the same ``A w``, for A (q, k), no more of them positive than its rank.

    Weights move along a null vector until one of them is gone. A reflection of the orthonormal null
    vectors (Householder's) leaves that candidate to one of them alone, which is dropped.
    """
    w = weights.copy()
    left = np.arange(len(w))
    N = _null_vectors(A)
    while N.shape[1] and not out_of_time():
        reach = np.linalg.norm(N, axis=1)
        # The candidate that is gone first if the weights take the straightest way to that.
        lightest = int(_quotient(w[left], reach).argmin())
        along = N @ (N[lightest] / reach[lightest])
        steps = _quotient(w[left], along)
        gone = int(steps.argmin())
        w[left] -= steps[gone] * along
        w[left[gone]] = 0.0
        N = np.delete(_reflected(N, gone), gone, axis=0)[:, 1:]
        left = np.delete(left, gone)
    return np.maximum(w, 0.0)


def _null_vectors(A: Array) -> Array:
    """Orthonormal null vectors (k, k - rank) of A (q, k)."""
    from scipy.linalg import qr

    Q, R, _ = qr(A.T, pivoting=True)
    sizes = np.abs(np.diag(R))
    rank = int((sizes > max(A.shape) * np.finfo(float).eps * sizes[0]).sum())
    return np.asarray(Q[:, rank:])


def _quotient(w: Array, by: Array) -> Array:
    """Steps (k,) after which weights that fall at some rates are zero; inf where they do not."""
    return np.divide(w, by, out=np.full(len(w), np.inf), where=by > 0)


def _reflected(N: Array, row: int) -> Array:
    """Columns N (k, q), reflected so that all but the first have no entry in a row."""
    v = N[row].copy()
    v[0] += np.copysign(np.linalg.norm(v), v[0])
    return N - np.outer(N @ v, v * (2 / (v @ v)))
