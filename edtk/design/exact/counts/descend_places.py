"""One place of a plan after another takes its best candidate, until none of them improves it."""

import numpy as np

from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.prices import GAIN, Pricing
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Indices

SWEEPS = 100  # over all places, at most, in each round: some ten are usual


def descend_places(pricing: Pricing, limits: Limits, places: Indices, ridge: float) -> Indices:
    """Improve plans by exchanging one place at a time for the best of all candidates.

    This is the modified Fedorov algorithm (Cook and Nachtsheim 1980), for many plans in step with
    each other: each operation on arrays serves all of them. A plan leaves when no place of it has
    a better candidate.

    Args:
        pricing: Prices of the criterion.
        limits: What plans must obey; the given ones do.
        places: Candidates (b, m) at the places of b plans.
        ridge: See `Pricing.prices`.

    Returns:
        Places (b, m) of plans that are no worse.
    """
    found = places.copy()
    for first in range(0, len(places), pricing.batch):
        part = slice(first, first + pricing.batch)
        for size in pricing.rounds:
            found[part] = _descend(pricing, limits, found[part], ridge, size)
            if out_of_time():
                break
    return found


def _descend(pricing: Pricing, limits: Limits, places: Indices, ridge: float, size: int) -> Indices:
    """A round of sweeps over plans that fit into a cache together."""
    places = places.copy()
    left = np.arange(len(places))
    for _ in range(SWEEPS):
        # Prices are computed anew for each sweep, so that rounding does not accumulate.
        own = places[left]
        prices = pricing.prices(own, ridge, size)
        moved = np.zeros(len(left), dtype=bool)
        for place in range(own.shape[1]):
            allowed = limits.allowed(own, place, pricing.candidates)
            new, gain = prices.best(place, allowed)
            better = np.flatnonzero(gain > GAIN)
            if len(better):
                prices.replace(better, place, new[better])
                own[better, place] = new[better]
                moved[better] = True
        places[left] = own
        left = left[moved]
        # Without time one sweep is enough: it tells all that a plan of so many places can.
        if not len(left) or out_of_time():
            break
    return places
