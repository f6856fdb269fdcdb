"""An order of poses in which the joints travel little."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
EXACT = 11  # poses up to which the best order is found by dynamic programming
SWAPPED = (
    1000  # poses up to which pairs of legs are exchanged; beyond, the nearest neighbour is next
)


def visiting_order(q: Array, span: Array) -> NDArray[np.int_]:
    """An open path through all poses: short, the shortest for a few poses.

    The length of a leg is the root of the sum of squares of the joints' travel, each divided by its range. Many poses
    are put in order by nearest neighbour, and legs are exchanged while that shortens the path (2-opt).

    Args:
        q: Joint variables (k, n) [rad or m].
        span: Range (n,) of each joint [rad or m].

    Returns:
        Indices (k,); the path begins at that of its ends which comes first in q.
    """
    x = q / span
    if len(x) > SWAPPED:
        order = _nearest(x)
    else:
        D = np.sqrt(((x[:, None] - x[None]) ** 2).sum(axis=-1))
        order = _shortest(D) if len(x) <= EXACT else _exchanged(D, _nearest(x))
    return order if order[0] <= order[-1] else order[::-1]


def _shortest(D: Array) -> NDArray[np.int_]:
    """The shortest open path by dynamic programming over sets of visited poses (Held and Karp 1962)."""
    k = len(D)
    cost = np.full((1 << k, k), np.inf)
    last = np.zeros((1 << k, k), dtype=int)
    cost[1 << np.arange(k), np.arange(k)] = 0.0
    for visited in range(1, 1 << k):
        for j in range(k):
            before = visited & ~(1 << j)
            if before and before != visited:
                ways = cost[before] + D[:, j]
                last[visited, j] = ways.argmin()
                cost[visited, j] = ways[last[visited, j]]
    visited, j = (1 << k) - 1, int(cost[-1].argmin())
    order = []
    while visited:
        order.append(j)
        visited, j = visited & ~(1 << j), int(last[visited, j])
    return np.array(order)


def _nearest(x: Array) -> NDArray[np.int_]:
    """From the first pose always on to the nearest one that is left."""
    left = np.ones(len(x), dtype=bool)
    order = np.zeros(len(x), dtype=int)
    for i in range(1, len(x)):
        left[order[i - 1]] = False
        rest = np.flatnonzero(left)
        order[i] = rest[((x[rest] - x[order[i - 1]]) ** 2).sum(axis=1).argmin()]
    return order


def _exchanged(D: Array, order: NDArray[np.int_]) -> NDArray[np.int_]:
    """Reverse the stretch of the path that shortens it most, until none does.

    Reversing the positions i..j replaces the legs (i-1, i) and (j, j+1) by (i-1, j) and (i, j+1); at the ends of the
    path one of each is missing. A pose of no distance to any other stands in for what is beyond the ends.
    """
    k = len(D)
    open_ended = np.zeros((k + 1, k + 1))
    open_ended[:k, :k] = D
    path = np.r_[k, order, k]
    least = 1e-12 * (1 + D.max())
    upper = np.triu(np.ones((k, k), dtype=bool), 1)
    while True:
        a, b = path[:-2], path[1:-1]  # before and at position i
        c, d = path[1:-1], path[2:]  # at and after position j
        legs = open_ended[a, b][:, None] + open_ended[c, d]
        change = np.where(upper, open_ended[np.ix_(a, c)] + open_ended[np.ix_(b, d)] - legs, 0.0)
        i, j = np.unravel_index(change.argmin(), change.shape)
        if change[i, j] >= -least:
            return path[1:-1]
        path[i + 1 : j + 2] = path[i + 1 : j + 2][::-1].copy()
