"""Plans at random, within limits: where searches start, and how they leave a local optimum."""

from collections.abc import Sequence

import numpy as np

from edtk.design.exact.counts.limits import Limits
from edtk.system.typing import Array, Indices

KICKED = 0.2  # part of the places that a kick draws anew; two at least
LEAST_KICKED = 2
AT_ONCE = 200_000  # chances that are drawn from together; such arrays stay in a core's cache


def draw_places(rng: np.random.Generator, limits: Limits, chances: Sequence[Array]) -> Indices:
    """Draw the places of plans one after the other, each from what the limits leave.

    Args:
        rng: Random numbers.
        limits: What the plans must obey.
        chances: Weights (n,), all positive, with which candidates are drawn, for each plan.

    Returns:
        Places (b, m).
    """
    n = len(chances[0])
    if not limits.restricts:
        return np.array([rng.choice(n, size=limits.m, p=own / own.sum()) for own in chances])
    order = rng.random((len(chances), limits.m)).argsort(axis=1)
    places = np.tile(_cheapest(limits, n), (len(chances), 1))
    return _redrawn(rng, limits, places, order, chances)


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
    if limits.restricts:
        return _redrawn(rng, limits, places, some, [np.ones(n)] * len(places))
    places = places.copy()
    places[np.arange(len(places))[:, None], some] = rng.integers(n, size=some.shape)
    return places


def _redrawn(
    rng: np.random.Generator,
    limits: Limits,
    places: Indices,
    some: Indices,
    chances: Sequence[Array],
) -> Indices:
    """Plans (b, m) with some places (b, k) of each drawn anew, in turn, within the limits."""
    n = len(chances[0])
    together = max(1, AT_ONCE // n)
    parts = [slice(first, first + together) for first in range(0, len(places), together)]
    drawn = [
        _redrawn_together(rng, limits, places[part], some[part], np.array(chances[part]))
        for part in parts
    ]
    return np.concatenate(drawn)


def _redrawn_together(
    rng: np.random.Generator, limits: Limits, places: Indices, some: Indices, chances: Array
) -> Indices:
    """A part of them, with the chances (b, n)."""
    b, n = chances.shape
    places = places.copy()
    each = np.arange(b)
    for place in some.T:
        allowed = limits.allowed(places, place, n)
        assert allowed is not None
        # Of independent exponential waits each is the shortest with its share of the rates.
        waits = rng.standard_exponential((b, n)) / chances
        waits[~allowed[:, :n]] = np.inf
        new = waits.argmin(axis=1)
        # Nothing else may fit; the place then keeps what it has.
        fits = np.isfinite(waits[each, new])
        places[each[fits], place[fits]] = new[fits]
    return places


def _cheapest(limits: Limits, n: int) -> Indices:
    """The least expensive plan (m,); empty places where no size is given."""
    if not limits.sized:
        return np.full(limits.m, n)
    costs = np.zeros(n) if limits.costs is None else limits.costs
    order = np.argsort(costs, kind="stable")
    most = np.full(n, limits.m) if limits.most is None else np.minimum(limits.most, limits.m)
    return np.repeat(order, most[order])[: limits.m]
