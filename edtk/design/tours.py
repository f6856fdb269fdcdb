"""Short tours: orders of visits in which an arm travels little, or little has to be changed."""

import numpy as np

from edtk.system.typing import Array, Indices, Mask

NEAR_NEIGHBOURS = 5  # neighbours of a pose that a leg may lead to, before longer legs are looked at
BEST_UP_TO = 11  # poses; dynamic programming takes time and memory in proportion to k^2 2^k
EXCHANGES_UP_TO = 300  # poses; exchanges take time in proportion to k^3
BEGINS = 20  # places at which a tour of any costs begins in turn
MOVED_UP_TO = 3  # places that move together
LEAST_GAIN = 1e-12  # relative: below that an exchange of legs is rounding, and might go on for ever


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
        distance, near = cKDTree(x[ends]).query(x[ends], min(NEAR_NEIGHBOURS + 2, len(ends)))
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
        free = np.zeros(len(x))  # the path may begin and end anywhere
        if few:
            order = _shortest(distance, free, free)
        else:
            order = _exchanged(distance, _nearest(x), free, free)
    return order if order[0] <= order[-1] else order[::-1]


def short_tour(
    seconds: Array, before: Array, after: Array, best_up_to: int = BEST_UP_TO
) -> Indices:
    """Find a short order of visits, the shortest for a few, where it is known how long legs take.

    Args:
        seconds: Time of the leg between any two places (k, k) [s], the same both ways.
        before: Time of the way to each place (k,), if the tour begins there [s].
        after: Time of the way from each place (k,), if it ends there [s].
        best_up_to: Number of places up to which the shortest tour is found.

    Returns:
        Indices (k,).
    """
    k = len(seconds)
    if k <= best_up_to:
        return _shortest(seconds, before, after)
    order = _exchanged(seconds, _next_best(seconds, before), before, after)
    other = _exchanged(seconds, _next_best(seconds, after)[::-1], before, after)
    tours = (order, other)
    return min(tours, key=lambda one: tour_seconds(seconds, before, after, one))


def cheap_tour(costs: Array, before: Array, best_up_to: int = BEST_UP_TO) -> Indices:
    """Find a cheap order of places, the cheapest for a few, whatever a way and the way back cost.

    From several places always on to the cheapest one that is left; then stretches of the path are
    reversed (2-opt), and short ones are moved (Or 1976), while that makes it cheaper.

    Args:
        costs: Cost of the way from each place to each other one (k, k).
        before: Cost of the way to each place (k,), if the tour begins there.
        best_up_to: Number of places up to which the cheapest tour is found.

    Returns:
        Indices (k,).
    """
    k = len(costs)
    nothing = np.zeros(k)
    if k <= best_up_to:
        return _shortest(costs, before, nothing)
    number = BEGINS if k <= EXCHANGES_UP_TO else 1
    begins = np.unique(np.linspace(0, k - 1, min(k, number)).astype(int))
    tours = [_next_best(costs, before)]
    tours += [_next_best(costs, np.where(np.arange(k) == i, -1.0, costs.max())) for i in begins]
    cheapest = tours[0]
    least = np.inf
    for order in tours:
        total = np.inf
        while True:
            order = _moved(costs, _exchanged(costs, order, before, nothing), before)
            found = tour_seconds(costs, before, nothing, order)
            if not found < total - LEAST_GAIN * (1 + total if np.isfinite(total) else 0.0):
                break
            total = found
        if total < least:
            least = total
            cheapest = order
    return cheapest


def cheapest_possible(costs: Array, before: Array) -> float:
    """A number that no order of places costs less than: their assignment to each other.

    Every place but the last one has one that follows, and every one but the first follows one.

    Args:
        costs: Cost of the way from each place to each other one (k, k).
        before: Cost of the way to each place (k,), if the tour begins there.
    """
    from scipy.optimize import linear_sum_assignment

    k = len(costs)
    ways = np.zeros((k + 1, k + 1))
    ways[:k, :k] = costs
    ways[k, :k] = before  # the way out; the last column is the end, which costs nothing
    never = 1.0 + ways.max() * (k + 1)
    np.fill_diagonal(ways, never)
    rows, columns = linear_sum_assignment(ways)
    assigned = float(ways[rows, columns].sum())
    both = np.minimum(costs, costs.T)
    return max(assigned, _least_tree(both) + float(before.min()))


def _least_tree(costs: Array) -> float:
    """The cost of the cheapest tree that joins all places (Prim 1957): a path is a tree."""
    away = costs[0].copy()
    joined = np.zeros(len(costs), dtype=bool)
    joined[0] = True
    total = 0.0
    for _ in range(len(costs) - 1):
        nearest = int(np.where(joined, np.inf, away).argmin())
        total += float(away[nearest])
        joined[nearest] = True
        away = np.minimum(away, costs[nearest])
    return total


def tour_seconds(seconds: Array, before: Array, after: Array, order: Indices) -> float:
    """Time of a tour's legs [s]; see `short_tour`."""
    legs = seconds[order[:-1], order[1:]].sum()
    return float(before[order[0]] + legs + after[order[-1]])


def _shortest(distance: Array, before: Array, after: Array) -> Indices:
    """The shortest path by dynamic programming over sets of visited poses (Held, Karp 1962).

    A set is a number whose bits say which poses are in it. `cost[s, j]` is the length of the
    shortest path through the set s that begins at j, and `then[s, j]` the pose after j on it.
    """
    k = len(distance)
    everywhere = (1 << k) - 1
    cost = np.full((1 << k, k), np.inf)
    then = np.zeros((1 << k, k), dtype=int)
    cost[1 << np.arange(k), np.arange(k)] = after
    for visited in range(1, 1 << k):
        for j in range(k):
            rest = visited & ~(1 << j)
            if rest and rest != visited:
                ways = cost[rest] + distance[j]
                then[visited, j] = ways.argmin()
                cost[visited, j] = ways[then[visited, j]]
    visited = everywhere
    j = int((cost[everywhere] + before).argmin())
    order = []
    while visited:
        order.append(j)
        following = int(then[visited, j])
        visited &= ~(1 << j)
        j = following
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


def _next_best(distance: Array, before: Array) -> Indices:
    """From the nearest place always on to the nearest one that is left."""
    left: Mask = np.ones(len(distance), dtype=bool)
    order = np.empty(len(distance), dtype=int)
    away = before
    for i in range(len(order)):
        rest = np.flatnonzero(left)
        order[i] = rest[away[rest].argmin()]
        left[order[i]] = False
        away = distance[order[i]]
    return order


def _exchanged(distance: Array, order: Indices, before: Array, after: Array) -> Indices:
    """Reverse the stretch of the path that shortens it most, until none does.

    Reversing the positions i..j replaces the legs (i-1, i) and (j, j+1) by (i-1, j) and (i, j+1).
    What lies before the path and after it are two more places. Where the way back costs something
    else, the legs between i and j count as well.
    """
    k = len(distance)
    with_ends = np.zeros((k + 2, k + 2))
    with_ends[:k, :k] = distance
    with_ends[k, :k] = before
    with_ends[:k, k + 1] = after
    path = np.r_[k, order, k + 1]
    least = LEAST_GAIN * (1 + with_ends.max())
    upper = np.triu(np.ones((k, k), dtype=bool), 1)
    while True:
        previous = path[:-2]
        at = path[1:-1]
        following = path[2:]
        legs = with_ends[previous, at][:, None] + with_ends[at, following]
        exchanged = with_ends[np.ix_(previous, at)] + with_ends[np.ix_(at, following)]
        # How much more the way up to each position costs when it is gone the other way.
        back = np.r_[0.0, np.cumsum(with_ends[at[1:], at[:-1]] - with_ends[at[:-1], at[1:]])]
        change = np.where(upper, exchanged - legs + (back - back[:, None]), 0.0)
        i, j = np.unravel_index(change.argmin(), change.shape)
        if change[i, j] >= -least:
            return path[1:-1]
        path[i + 1 : j + 2] = path[i + 1 : j + 2][::-1].copy()


def _moved(costs: Array, order: Indices, before: Array) -> Indices:
    """Move the stretch of a few places whose move makes the path cheapest, until none does."""
    k = len(costs)
    ways = np.zeros((k + 2, k + 2))
    ways[:k, :k] = costs
    ways[k, :k] = before
    path = np.r_[k, order, k + 1]
    least = LEAST_GAIN * (1 + ways.max())
    while True:
        best = (-least, 0, 0, 0)
        for length in range(1, min(MOVED_UP_TO, k - 1) + 1):
            # The stretch begins at i; it is put between the positions j and j + 1.
            i = np.arange(1, k - length + 2)[:, None]
            j = np.arange(k + 1)[None]
            first, last = path[i], path[i + length - 1]
            around, behind = path[i - 1], path[i + length]
            out = ways[around, behind] - ways[around, first] - ways[last, behind]
            into = ways[path[j], first] + ways[last, path[j + 1]] - ways[path[j], path[j + 1]]
            change = np.where((j < i - 1) | (j >= i + length), out + into, 0.0)
            at = np.unravel_index(change.argmin(), change.shape)
            if change[at] < best[0]:
                best = (float(change[at]), length, int(at[0]) + 1, int(at[1]))
        _, length, begin, where = best
        if not length:
            return path[1:-1]
        stretch = path[begin : begin + length]
        rest = np.r_[path[:begin], path[begin + length :]]
        where = where if where < begin else where - length
        path = np.r_[rest[: where + 1], stretch, rest[where + 1 :]]
