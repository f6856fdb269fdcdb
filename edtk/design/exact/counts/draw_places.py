"""Plans at random, within limits: where searches start, and how they leave a local optimum."""

import numpy as np

from edtk.design.exact.counts.limits import Limits
from edtk.system.typing import Array, Indices

KICKED = 0.2  # part of the places that a kick draws anew; two at least
LEAST_KICKED = 2


def draw_places(rng: np.random.Generator, limits: Limits, chances: Array) -> Indices:
    """Draw the places (m,) of a plan one after the other, each from what the limits leave.

    Args:
        rng: Random numbers.
        limits: What the plan must obey.
        chances: Weights (n,) with which candidates are drawn, all positive.
    """
    if not limits.restricts:
        return rng.choice(len(chances), size=limits.m, p=chances / chances.sum())
    return _redrawn(
        rng, limits, _cheapest(limits, len(chances)), rng.permutation(limits.m), chances
    )


def kicked(
    rng: np.random.Generator, limits: Limits, places: Indices, n: int, number: int | None = None
) -> Indices:
    """Draw a few places of plans (b, m) anew, at random from n candidates.

    Args:
        rng: Random numbers.
        limits: What the plans obey.
        places: The plans.
        n: Number of candidates.
        number: Number of places; None for a part of all.
    """
    if number is None:
        number = max(LEAST_KICKED, round(KICKED * limits.m))
    number = min(limits.m, number)
    some = rng.random(places.shape).argsort(axis=1)[:, :number]
    if not limits.restricts:
        places = places.copy()
        places[np.arange(len(places))[:, None], some] = rng.integers(n, size=some.shape)
        return places
    alike = np.ones(n)
    drawn = [_redrawn(rng, limits, *own, alike) for own in zip(places, some, strict=True)]
    return np.array(drawn)


def _redrawn(
    rng: np.random.Generator, limits: Limits, places: Indices, some: Indices, chances: Array
) -> Indices:
    """The plan (m,) with some places drawn anew, in turn, within the limits."""
    n = len(chances)
    places = places.copy()
    for place in some:
        allowed = limits.allowed(places[None], int(place), n)
        assert allowed is not None
        p = np.append(chances, 0.0)[: allowed.shape[1]] * allowed[0]
        # Nothing else may fit; the place then keeps what it has.
        if p.any():
            places[place] = rng.choice(len(p), p=p / p.sum())
    return places


def _cheapest(limits: Limits, n: int) -> Indices:
    """The least expensive plan (m,); empty places where no size is given."""
    if not limits.sized:
        return np.full(limits.m, n)
    costs = np.zeros(n) if limits.costs is None else limits.costs
    order = np.argsort(costs, kind="stable")
    most = np.full(n, limits.m) if limits.most is None else np.minimum(limits.most, limits.m)
    return np.repeat(order, most[order])[: limits.m]
