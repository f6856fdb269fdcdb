"""Where a search for exact plans starts: rounded relaxations, exchanged candidates, and chance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from criteria import Criterion
from edtk.design.candidates import Candidates
from edtk.design.exchange import exchange
from edtk.design.problem import Problem
from edtk.design.repeat import best_repeats
from edtk.design.round import apportion

Array = NDArray[np.float64]
Indices = NDArray[np.int_]


@dataclass(frozen=True, eq=False)
class Starts:
    """Plans of k experiments with repetitions.

    Attributes:
        x: Design variables (b, k, v).
        repeats: Whole numbers (b, k) of one sum; zero where an experiment is left out.
    """

    x: Array
    repeats: Array

    def __getitem__(self, chosen: Indices) -> "Starts":
        """Some of them."""
        return Starts(self.x[chosen], self.repeats[chosen])


def starts(
    criterion: Criterion,
    m: int,
    k: int,
    support: Candidates,
    weights: Array,
    fresh: Candidates,
    size: int,
    seed: tuple[int, ...],
) -> Starts:
    """Plans of m experiments at k places at most: half exchanged, a quarter drawn by weight, a quarter at random.

    The first is the relaxed design, rounded by efficient apportionment; it is there whatever the seed.

    Args:
        criterion: What the exchange improves.
        m: Number of experiments.
        k: Number of places.
        support: Experiments of the relaxed design.
        weights: Their weights.
        fresh: Other experiments to choose from.
        size: Number of plans.
        seed: Seed.
    """
    rng = np.random.default_rng(seed)
    pool, n = support + fresh, len(weights)
    even = apportion(np.ones(k), m).astype(float)
    places, repeats = [np.resize(np.argsort(-weights, kind="stable")[:k], k)], [_rounded(weights, m, k)]
    for i in range(1, size):
        by_weight = rng.choice(n, size=k, p=weights)
        anywhere = rng.choice(len(pool.x), size=k)
        if i % 4 == 0:
            plan, times = by_weight, even
        elif i % 4 == 2:
            plan, times = anywhere, even
        else:
            plan, times = exchanged(pool.problem, criterion, anywhere, even, thorough=False)
        places.append(plan)
        repeats.append(times)
    return Starts(pool.x[np.array(places)], np.array(repeats))


def exchanged(
    problem: Problem, criterion: Criterion, places: Indices, repeats: Array, thorough: bool = True
) -> tuple[Indices, Array]:
    """Places (k,) and repetitions (k,) exchanged in turn, until neither improves the plan; see `exchange`."""
    cost = np.inf
    while True:
        places, reached = exchange(problem, criterion, places, repeats, thorough=thorough)
        if len(places) == repeats.sum() or not reached < cost * (1 - 1e-9):
            return places, repeats
        cost = reached
        repeats = best_repeats(criterion, problem.blocks(places), repeats)


def _rounded(weights: Array, m: int, k: int) -> Array:
    """Apportionment (k,) of m experiments to the k heaviest places; what is beyond the support gets none."""
    heaviest = np.sort(weights)[::-1][:k]
    return np.pad(apportion(heaviest, m), (0, k - len(heaviest))).astype(float)
