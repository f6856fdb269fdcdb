"""Plans that are improved by exchanges of places and by descents in turn."""

from collections.abc import Callable

import numpy as np

from criteria import Criterion
from edtk.design.candidates import Candidates
from edtk.design.design_space import DesignSpace
from edtk.design.exact.best_repeats import best_repeats
from edtk.design.exact.descent import FINE, Answer, Descent, Search
from edtk.design.exact.exchange_in_turn import exchange_in_turn
from edtk.design.exact.plans import Plans
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices

# Rounds of refinement, with an exchange between them. The last exchange still improved the best
# plan by 1e-4 in a quarter of 36 batches; more gain is left to the next batch.
ROUNDS = 4
GAIN = 1e-6  # relative improvement for which another round is made


def exchange_and_refine(
    space: DesignSpace,
    criterion: Criterion,
    first: Answer,
    fresh: Callable[[int], Candidates],
) -> Search:
    """Exchange places of plans and refine them, as long as one of the plans becomes better.

    A place may be exchanged for a fresh candidate, or for a place of another plan.

    Args:
        space: Model and feasible set.
        criterion: The criterion to improve.
        first: Costs (b,) of the plans, and the plans.
        fresh: The candidates of each turn.

    Yields:
        Descents; costs and plans at their ends are sent back.

    Returns:
        Costs (b,), the best first, and the plans.
    """
    costs, plans = first
    for turn in range(1, ROUNDS):
        if out_of_time():
            break
        exchanged = _exchanged(space, criterion, plans, fresh(turn))
        reached, exchanged = yield Descent(exchanged, FINE)
        better = reached < costs * (1 - GAIN)
        if not better.any():
            break
        costs = np.where(better, reached, costs)
        plans = plans.replaced(better, exchanged)
    order = np.argsort(costs, kind="stable")
    return costs[order], plans[order]


def _exchanged(space: DesignSpace, criterion: Criterion, plans: Plans, fresh: Candidates) -> Plans:
    """Plans after repetitions were moved and places exchanged, wherever that helps."""
    own = plans.x.reshape(-1, plans.x.shape[-1])
    pool = Candidates(own, space.problem(own)) + fresh
    places = np.arange(len(own)).reshape(plans.repeats.shape)
    repeats = _best_repeats(criterion, pool, places, plans.repeats)
    places, repeats = exchange_in_turn(pool.problem, criterion, places, repeats)
    return Plans(pool.x[places], repeats)


def _best_repeats(criterion: Criterion, pool: Candidates, places: Indices, repeats: Array) -> Array:
    """Best repetitions (b, k) of plans at fixed places of the pool (b, k)."""
    prior = pool.problem.prior
    blocks = pool.problem.blocks(places)
    return np.array(
        [
            best_repeats(criterion, own, times, prior)
            for own, times in zip(blocks, repeats, strict=True)
        ]
    )
