"""Starts of a search for exact plans: the rounded relaxation, exchanged candidates, and chance."""

import numpy as np

from criteria import Criterion
from edtk.design.candidates import Candidates
from edtk.design.exact.apportion import apportion
from edtk.design.exact.exchange_in_turn import exchange_in_turn
from edtk.design.exact.plans import Plans
from edtk.system.typing import Array, Indices


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
    chosen = [_draw_places(rng, i, weights, len(pool.x), places) for i in range(1, size)]
    indices = np.array([np.resize(heaviest, places), *chosen])
    times = np.array([_rounded(weights, m, places), *[even] * (size - 1)])
    # Starts are refined afterwards, so that a look at all candidates would be wasted on them.
    indices[1::2], times[1::2] = exchange_in_turn(
        pool.problem, criterion, indices[1::2], times[1::2], thorough=False
    )
    return Plans(pool.x[indices], times)


def _draw_places(
    rng: np.random.Generator, number: int, weights: Array, candidates: int, places: int
) -> Indices:
    """Indices (places,) of the plan of this number, among so many candidates, the support first."""
    # Both are drawn for every plan, so that its random numbers do not depend on the others' kind.
    by_weight = rng.choice(len(weights), size=places, p=weights)
    anywhere = rng.choice(candidates, size=places)
    return by_weight if number % 4 == 0 else anywhere


def _rounded(weights: Array, m: int, places: int) -> Array:
    """Apportionment (places,) of m experiments to the heaviest places; zero beyond the support."""
    heaviest = np.sort(weights)[::-1][:places]
    return np.pad(apportion(heaviest, m), (0, places - len(heaviest))).astype(float)
