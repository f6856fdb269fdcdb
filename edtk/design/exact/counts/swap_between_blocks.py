"""Experiments of two blocks that change places."""

import numpy as np

from criteria import Criterion
from edtk.design.exact.counts.prices import GAIN
from edtk.design.exact.counts.scatter import Scatter
from edtk.system.typing import Array, Indices

SWEEPS = 50  # over all places, at most


def swap_between_blocks(criterion: Criterion, scatter: Scatter, places: Indices) -> Indices:
    """Swap experiments of different blocks in each plan, as long as that improves it.

    Where every candidate may be taken once only, and all are, nothing else can improve a plan.

    Args:
        criterion: The criterion to minimise.
        scatter: Rows of the candidates, and the blocks.
        places: Candidates (b, m) at the places of b plans.

    Returns:
        Places (b, m) of plans that are no worse.
    """
    places = places.copy()
    costs = _costs(criterion, scatter, places)
    for _ in range(SWEEPS):
        before = costs.copy()
        for place in range(places.shape[1]):
            _swap(criterion, scatter, places, costs, place)
        if not (costs < before * (1 - GAIN)).any():
            break
    return places


def _swap(
    criterion: Criterion, scatter: Scatter, places: Indices, costs: Array, place: int
) -> None:
    """Swap the experiment at one place with the best one of another block, in all plans."""
    block_of = scatter.limits.block_of
    others = np.flatnonzero(block_of != block_of[place])
    trials = np.repeat(places[:, None], len(others), axis=1)
    each = np.arange(len(others))
    trials[:, each, others] = places[:, place, None]
    trials[:, each, place] = places[:, others]
    flat = trials.reshape(-1, places.shape[1])
    reached = _costs(criterion, scatter, flat).reshape(len(places), -1)
    best = reached.argmin(axis=1)
    least = reached[np.arange(len(places)), best]
    better = least < costs * (1 - GAIN)
    places[better] = trials[better, best[better]]
    costs[better] = least[better]


def _costs(criterion: Criterion, scatter: Scatter, places: Indices) -> Array:
    """Costs (b,) of plans (b, m)."""
    return np.asarray(criterion.cost(scatter.information(places))).reshape(-1)
