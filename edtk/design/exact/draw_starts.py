"""Starts of a search for exact plans: the rounded relaxation, exchanged candidates, and chance."""

import numpy as np

from criteria import Criterion
from edtk.design.candidates import Candidates
from edtk.design.exact.apportion import apportion
from edtk.design.exact.exchange_in_turn import exchange_in_turn
from edtk.design.exact.plans import Plans
from edtk.system.typing import Array


def draw_starts(
    criterion: Criterion,
    m: int,
    places: int,
    support: Candidates,
    weights: Array,
    fresh: Candidates,
    size: int,
    seed: tuple[int, ...],
) -> Plans:
    """Draw plans of m experiments from which a search may start.

    The first plan is the relaxed design, rounded by efficient apportionment, whatever the seed. Of
    the others every second one is exchanged, every fourth has places drawn by weight, and every
    fourth has random places.

    Args:
        criterion: The criterion that the exchange improves.
        m: Number of experiments.
        places: Number of places in a plan, at most m.
        support: Experiments of the relaxed design.
        weights: Their weights.
        fresh: Further experiments to choose from.
        size: Number of plans.
        seed: Seed.
    """
    rng = np.random.default_rng(seed)
    pool = support + fresh
    even = apportion(np.ones(places), m).astype(float)
    heaviest = np.argsort(-weights, kind="stable")[:places]
    chosen = [np.resize(heaviest, places)]
    repeats = [_rounded(weights, m, places)]
    for i in range(1, size):
        # Both are drawn in every turn, so that the sequence of random numbers is the same however
        # the turns are used.
        by_weight = rng.choice(len(weights), size=places, p=weights)
        anywhere = rng.choice(len(pool.x), size=places)
        chosen.append(by_weight if i % 4 == 0 else anywhere)
        repeats.append(even)
    indices = np.array(chosen)
    times = np.array(repeats)
    # Starts are refined afterwards, so that a look at all candidates would be wasted on them.
    indices[1::2], times[1::2] = exchange_in_turn(
        pool.problem, criterion, indices[1::2], times[1::2], thorough=False
    )
    return Plans(pool.x[indices], times)


def _rounded(weights: Array, m: int, places: int) -> Array:
    """Apportionment (places,) of m experiments to the heaviest places; zero beyond the support."""
    heaviest = np.sort(weights)[::-1][:places]
    return np.pad(apportion(heaviest, m), (0, places - len(heaviest))).astype(float)
