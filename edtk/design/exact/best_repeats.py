"""How often to measure each of a few poses: whole numbers that no single move improves."""

import numpy as np
from numpy.typing import NDArray

from criteria import Criterion

Array = NDArray[np.float64]
CHUNK = 20_000  # moves that are judged at once


def best_repeats(criterion: Criterion, blocks: Array, repeats: Array) -> Array:
    """Move measurements from one pose to another, as long as that lowers the cost; the steepest move first.

    Of many measurements many are moved at once to begin with, half as many when that no longer helps, and so on.

    Args:
        criterion: What to improve.
        blocks: Information of one measurement in each pose (k, p, p).
        repeats: Whole numbers to start from (k,); zero is allowed.

    Returns:
        Whole numbers (k,) of the same sum; none of the k (k - 1) moves of a single measurement lowers their cost.
    """
    r, k = np.array(repeats, dtype=float), len(repeats)
    M = np.tensordot(r, blocks, 1)
    cost = float(criterion.cost(M))
    moved = 2.0 ** np.floor(np.log2(max(1.0, r.sum() / k)))
    while k > 1 and moved >= 1:
        costs = np.empty((k, k))  # to the first pose from the second
        for part in np.array_split(np.arange(k), -(-k * k // CHUNK)):
            costs[part] = criterion.cost(M + moved * (blocks[part, None] - blocks))
        costs[:, r < moved] = np.inf
        to, source = divmod(int(costs.argmin()), k)
        tried = r.copy()
        tried[to] += moved
        tried[source] -= moved
        trial = np.tensordot(
            tried, blocks, 1
        )  # summed anew, or equal poses are exchanged for ever by rounding
        reached = float(criterion.cost(trial))
        if max(reached, float(costs[to, source])) < cost * (1 - 1e-12):
            r, M, cost = tried, trial, reached
        else:
            moved /= 2
    return r
