"""How often to measure each of a few poses."""

import numpy as np

from criteria import Criterion
from edtk.system.typing import Array

MOVES_AT_ONCE = 20_000  # their matrices, of some megabytes, stay in a core's cache
GAIN = 1e-12  # relative improvement that counts: less than this may be rounding


def best_repeats(
    criterion: Criterion, blocks: Array, repeats: Array, prior: Array | None = None
) -> Array:
    """Distribute measurements over poses so that no single move improves the plan.

    A move gives measurements of one pose to another. The best one is made as long as it lowers the
    cost. It has many measurements at first, half as many when that no longer helps, at last one.

    Args:
        criterion: The criterion to improve.
        blocks: Information of one measurement in each pose (k, p, p).
        repeats: Whole numbers to start from (k,); zero is allowed.
        prior: Prior information (p, p) per single measurement, see `Problem`.

    Returns:
        Whole numbers (k,) of the same sum, whose cost no move of a single measurement lowers.
    """
    r = np.array(repeats, dtype=float)
    k = len(r)
    constant = 0.0 if prior is None else r.sum() * prior
    M = np.tensordot(r, blocks, 1) + constant
    cost = float(criterion.cost(M))
    moved = 2.0 ** np.floor(np.log2(max(1.0, r.sum() / k)))
    while k > 1 and moved >= 1:
        costs = _costs_of_moves(criterion, blocks, M, r, moved)
        to, source = divmod(int(costs.argmin()), k)
        tried = r.copy()
        tried[to] += moved
        tried[source] -= moved
        # The sum is computed anew. An update would let rounding accumulate, and equal poses would
        # be exchanged for ever, each time for an imaginary gain.
        trial = np.tensordot(tried, blocks, 1) + constant
        reached = float(criterion.cost(trial))
        if max(reached, float(costs[to, source])) < cost * (1 - GAIN):
            r = tried
            M = trial
            cost = reached
        else:
            moved /= 2
    return r


def _costs_of_moves(criterion: Criterion, blocks: Array, M: Array, r: Array, moved: float) -> Array:
    """Costs (k, k) after a move to the first pose from the second; inf where it has too few."""
    k = len(r)
    costs = np.empty((k, k))
    parts = -(-k * k // MOVES_AT_ONCE)
    for part in np.array_split(np.arange(k), parts):
        costs[part] = criterion.cost(M + moved * (blocks[part, None] - blocks))
    costs[:, r < moved] = np.inf
    return costs
