"""A short path through very many poses."""

import numpy as np

from edtk.system.typing import Array, Indices

NEAR = 5  # neighbours of a pose that a leg may lead to, before longer legs are looked at


def shortest_legs(x: Array) -> Indices:
    """Find an open path through all points, from the shortest legs on.

    The shortest leg that joins the ends of two stretches of the path is laid first (the greedy
    heuristic; Bentley 1992). Legs are looked for among neighbours, then among those of the
    remaining ends, so that the time grows as k log k.

    Args:
        x: Points (k, n).

    Returns:
        Indices (k,), in the order of the path; equal points come one after another.
    """
    # Among very many equal points a search for neighbours would look at all of them.
    points, number = np.unique(x, axis=0, return_inverse=True)
    number = number.ravel()
    place = np.empty(len(points), dtype=int)
    place[_path(points)] = np.arange(len(points))
    return np.argsort(place[number], kind="stable")


def _path(x: Array) -> Indices:
    """The path through points (k, n) that are all different."""
    from scipy.spatial import cKDTree

    k = len(x)
    if k == 1:
        return np.zeros(1, dtype=int)
    legs: list[list[int]] = [[] for _ in range(k)]
    stretch = list(range(k))
    missing = k - 1
    while missing:
        ends = np.array([i for i in range(k) if len(legs[i]) < 2])
        # A pose, and perhaps the other end of its stretch, are among its own neighbours.
        distance, near = cKDTree(x[ends]).query(x[ends], min(NEAR + 2, len(ends)))
        for a, b in _by_length(ends, ends[near], distance):
            if len(legs[a]) == 2 or len(legs[b]) == 2:
                continue
            first = _root(stretch, a)
            second = _root(stretch, b)
            if first != second:
                stretch[first] = second
                legs[a].append(b)
                legs[b].append(a)
                missing -= 1
    return _walk(legs)


def _by_length(ends: Indices, near: Indices, distance: Array) -> list[list[int]]:
    """Pairs of points, each once, the nearest first."""
    pairs = np.stack([np.broadcast_to(ends[:, None], near.shape), near], axis=-1).reshape(-1, 2)
    pairs = np.sort(pairs, axis=1)
    chosen = np.flatnonzero(pairs[:, 0] != pairs[:, 1])
    # Equal distances are told apart by the numbers, so that the path is the same everywhere.
    order = np.lexsort((pairs[chosen, 1], pairs[chosen, 0], distance.ravel()[chosen]))
    return pairs[chosen[order]].tolist()


def _root(stretch: list[int], i: int) -> int:
    """The number of the stretch that a point is in; the way there is halved."""
    while stretch[i] != i:
        stretch[i] = stretch[stretch[i]]
        i = stretch[i]
    return i


def _walk(legs: list[list[int]]) -> Indices:
    """The points from one end of the path to the other."""
    before = -1
    at = next(i for i, own in enumerate(legs) if len(own) == 1)
    order = [at]
    while len(order) < len(legs):
        following = next(i for i in legs[at] if i != before)
        before = at
        at = following
        order.append(at)
    return np.array(order)
