"""Where a search for exact plans starts: rounded relaxations, exchanged candidates, and chance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from criteria import Criterion
from edtk.design.candidates import Candidates
from edtk.design.exact.apportion import apportion
from edtk.design.exact.best_repeats import best_repeats
from edtk.design.exact.exchange import exchange
from edtk.design.problem import Problem

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
    places, repeats = (
        [np.resize(np.argsort(-weights, kind="stable")[:k], k)],
        [_rounded(weights, m, k)],
    )
    for i in range(1, size):
        by_weight = rng.choice(n, size=k, p=weights)
        anywhere = rng.choice(len(pool.x), size=k)
        places.append(by_weight if i % 4 == 0 else anywhere)
        repeats.append(even)
    plans, times = np.array(places), np.array(repeats)
    plans[1::2], times[1::2] = exchanged(
        pool.problem, criterion, plans[1::2], times[1::2], thorough=False
    )
    return Starts(pool.x[plans], times)


def exchanged(
    problem: Problem, criterion: Criterion, plans: Indices, repeats: Array, thorough: bool = True
) -> tuple[Indices, Array]:
    """Places (b, k) and repetitions (b, k) exchanged in turn until neither improves a plan; see `exchange`."""
    plans, repeats, costs = plans.copy(), repeats.copy(), np.full(len(plans), np.inf)
    left = np.arange(len(plans))
    while len(left):
        plans[left], reached = exchange(
            problem, criterion, plans[left], repeats[left], thorough=thorough
        )
        better = (reached < costs[left] * (1 - 1e-9)) & (repeats[left].sum(axis=1) > plans.shape[1])
        costs[left] = reached
        left = left[better]
        for i in left:
            repeats[i] = best_repeats(criterion, problem.blocks(plans[i]), repeats[i])
    return plans, repeats


def _rounded(weights: Array, m: int, k: int) -> Array:
    """Apportionment (k,) of m experiments to the k heaviest places; what is beyond the support gets none."""
    heaviest = np.sort(weights)[::-1][:k]
    return np.pad(apportion(heaviest, m), (0, k - len(heaviest))).astype(float)
