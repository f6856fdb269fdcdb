"""Places and repetitions of plans, exchanged in turn."""

import numpy as np

from criteria import Criterion
from edtk.design.exact.best_repeats import best_repeats
from edtk.design.exact.exchange import exchange
from edtk.design.problem import Problem
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices

GAIN = 1e-9  # relative improvement by new places for which repetitions are distributed anew


def exchange_in_turn(
    problem: Problem, criterion: Criterion, places: Indices, repeats: Array, thorough: bool = True
) -> tuple[Indices, Array]:
    """Exchange places and redistribute repetitions, until neither improves a plan.

    Args:
        problem: The candidates.
        criterion: The criterion to improve.
        places: Indices of the candidates (b, k) of b plans.
        repeats: Whole numbers of measurements (b, k).
        thorough: See `exchange`.

    Returns:
        Places (b, k) and repetitions (b, k) of the same sums.
    """
    places = places.copy()
    repeats = repeats.copy()
    costs = np.full(len(places), np.inf)
    left = np.arange(len(places))
    while len(left):
        places[left], reached = exchange(
            problem, criterion, places[left], repeats[left], thorough=thorough
        )
        improved = reached < costs[left] * (1 - GAIN)
        # With one measurement a place, a new distribution is the same as an exchange of places.
        repeated = repeats[left].sum(axis=1) > places.shape[1]
        costs[left] = reached
        left = left[improved & repeated & (not out_of_time())]
        for i in left:
            blocks = problem.blocks(places[i])
            repeats[i] = best_repeats(criterion, blocks, repeats[i], problem.prior)
    return places, repeats
