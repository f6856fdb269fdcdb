"""An order of poses in which the joints travel little."""

import numpy as np

from edtk.calibration.shortest_legs import shortest_legs
from edtk.system.typing import Array, Indices, Mask

BEST_UP_TO = 11  # poses; dynamic programming takes time and memory in proportion to k^2 2^k
EXCHANGES_UP_TO = 300  # poses; exchanges take time in proportion to k^3
LEAST_GAIN = 1e-12  # relative: below that an exchange of legs is rounding, and might go on for ever


def visiting_order(
    q: Array, span: Array, best_up_to: int = BEST_UP_TO, exchanges_up_to: int = EXCHANGES_UP_TO
) -> Indices:
    """Find an open path through all poses: short, the shortest for a few poses.

    The length of a leg is the root of the sum of squares of the joints' travel, each divided by its
    range. Many poses are put in order by nearest neighbour, and legs are exchanged while that
    shortens the path (2-opt). Very many are joined from the shortest legs on.

    Args:
        q: Joint variables (k, n) [rad or m].
        span: Range (n,) of each joint [rad or m].
        best_up_to: Number of poses up to which the shortest path is found.
        exchanges_up_to: Number of poses up to which legs are exchanged.

    Returns:
        Indices (k,); the path begins at that of its ends which comes first in q.
    """
    x = q / span
    if len(x) > exchanges_up_to:
        order = shortest_legs(x)
    else:
        distance = np.sqrt(((x[:, None] - x[None]) ** 2).sum(axis=-1))
        few = len(x) <= best_up_to
        order = _shortest(distance) if few else _exchanged(distance, _nearest(x))
    return order if order[0] <= order[-1] else order[::-1]


def _shortest(distance: Array) -> Indices:
    """The shortest open path by dynamic programming over sets of visited poses (Held, Karp 1962).

    A set is a number whose bits say which poses are in it. `cost[s, j]` is the length of the
    shortest path through the set s that ends at j, and `last[s, j]` the pose before j on it.
    """
    k = len(distance)
    everywhere = (1 << k) - 1
    cost = np.full((1 << k, k), np.inf)
    last = np.zeros((1 << k, k), dtype=int)
    cost[1 << np.arange(k), np.arange(k)] = 0.0
    for visited in range(1, 1 << k):
        for j in range(k):
            before = visited & ~(1 << j)
            if before and before != visited:
                ways = cost[before] + distance[:, j]
                last[visited, j] = ways.argmin()
                cost[visited, j] = ways[last[visited, j]]
    visited = everywhere
    j = int(cost[everywhere].argmin())
    order = []
    while visited:
        order.append(j)
        before = int(last[visited, j])
        visited &= ~(1 << j)
        j = before
    return np.array(order)


def _nearest(x: Array) -> Indices:
    """From the first pose always on to the nearest one that is left."""
    left: Mask = np.ones(len(x), dtype=bool)
    order = np.zeros(len(x), dtype=int)
    for i in range(1, len(x)):
        left[order[i - 1]] = False
        rest = np.flatnonzero(left)
        squares = ((x[rest] - x[order[i - 1]]) ** 2).sum(axis=1)
        order[i] = rest[squares.argmin()]
    return order


def _exchanged(distance: Array, order: Indices) -> Indices:
    """Reverse the stretch of the path that shortens it most, until none does.

    Reversing the positions i..j replaces the legs (i-1, i) and (j, j+1) by (i-1, j) and (i, j+1);
    at the ends of the path one of each is missing. A pose of no distance to any other stands in
    for the missing ones.
    """
    k = len(distance)
    open_ended = np.zeros((k + 1, k + 1))
    open_ended[:k, :k] = distance
    path = np.r_[k, order, k]
    least = LEAST_GAIN * (1 + distance.max())
    upper = np.triu(np.ones((k, k), dtype=bool), 1)
    while True:
        before = path[:-2]
        at = path[1:-1]
        after = path[2:]
        legs = open_ended[before, at][:, None] + open_ended[at, after]
        exchanged = open_ended[np.ix_(before, at)] + open_ended[np.ix_(at, after)]
        change = np.where(upper, exchanged - legs, 0.0)
        i, j = np.unravel_index(change.argmin(), change.shape)
        if change[i, j] >= -least:
            return path[1:-1]
        path[i + 1 : j + 2] = path[i + 1 : j + 2][::-1].copy()
