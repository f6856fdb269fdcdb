"""How often to measure each of a few poses: whole numbers that no single move improves."""

import numpy as np
from numpy.typing import NDArray

from criteria import Criterion

Array = NDArray[np.float64]


def best_repeats(criterion: Criterion, blocks: Array, repeats: Array) -> Array:
    """Move one measurement from one pose to another, as long as that lowers the cost; the steepest move first.

    Args:
        criterion: What to improve.
        blocks: Information of one measurement in each pose (k, p, p).
        repeats: Whole numbers to start from (k,); zero is allowed.

    Returns:
        Whole numbers (k,) of the same sum; none of the k (k - 1) single moves lowers their cost.
    """
    r = np.array(repeats, dtype=float)
    moves = np.eye(len(r))[:, None] - np.eye(len(r))[None]  # from the second index to the first
    cost = float(criterion.cost(np.tensordot(r, blocks, 1)))
    while len(r) > 1:
        trial = r + moves
        costs = np.where((trial >= 0).all(axis=-1), criterion.cost(np.tensordot(trial, blocks, 1)), np.inf)
        best = np.unravel_index(int(costs.argmin()), costs.shape)
        if not costs[best] < cost * (1 - 1e-12):
            break
        r, cost = trial[best], float(costs[best])
    return r
