"""Many descents from many starts, the best plan of them, and how often it was found."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from criteria import Criterion
from criteria.linalg.inverse import guarded_inverse
from edtk.design.exact.apportion import apportion
from edtk.design.exact.counts.descend_places import descend_places
from edtk.design.exact.counts.draw_places import draw_places, kicked
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.prices import Pricing
from edtk.design.exact.counts.scatter import Scatter
from edtk.design.exact.counts.swap_between_blocks import swap_between_blocks
from edtk.system.typing import Array, Indices, Mask

# Part of the candidates' mean information that is added to every plan at first, so that a singular
# start has prices: far below what a plan of so many places tells, far above rounding.
RIDGE = 1e-6
ACCURATE = 1e-8  # least eigenvalue at unit diagonal of a plan whose inverse has half its digits
SAME = 1e-9  # relative difference of costs up to which two plans are equally good
PROVED = 1e-9  # relative distance to the bound at which nothing is left to find
EFFORT = 1e10  # products that the starts may take which bring no improvement
LEAST_STARTS = 4  # of them
MOST_WAVES = 1024


@dataclass(frozen=True, eq=False)
class FoundCounts:
    """The best plan of a search.

    Attributes:
        places: Candidates (m,) at its places.
        cost: Its cost.
        starts: Number of starts.
        found: How many of them led to a plan as good.
        ended: Why the search ended: "starts", "stagnation", "proved" or "interrupted".
    """

    places: Indices
    cost: float
    starts: int
    found: int
    ended: str


@dataclass(frozen=True, eq=False)
class CountsSearch:
    """A search for the best plan within limits, ready to run.

    Attributes:
        criterion: The criterion to minimise.
        scatter: Rows of the candidates, and the limits.
        pricing: How exchanges are priced.
        relaxed: Counts (n,) of the relaxation; zeros where there is none.
        bound: No plan costs less.
    """

    criterion: Criterion
    scatter: Scatter
    pricing: Pricing
    relaxed: Array
    bound: float

    @property
    def limits(self) -> Limits:
        """What a plan must obey."""
        return self.scatter.limits

    def run(
        self, seed: int, starts: int | None, progress: Callable[[int, float], object]
    ) -> FoundCounts:
        """Search from so many starts, or until as many again as it took bring nothing better.

        Wave after wave depends on the seed and its number alone.
        """
        patience = self._patience()
        most = MOST_WAVES * self.pricing.wave if starts is None else starts
        # A wave of long searches shall not hold more starts than are worth it.
        wave = min(self.pricing.wave, patience) if starts is None else self.pricing.wave
        record = _Record()
        ended = "starts"
        try:
            while record.starts < most:
                size = min(wave, most - record.starts)
                record.enter(*self._wave(seed, record.waves, size))
                progress(record.starts, record.cost)
                if self._is_proved(record.cost):
                    ended = "proved"
                    break
                idle = record.starts - record.improved
                if starts is None and idle >= max(patience, record.starts // 2):
                    ended = "stagnation"
                    break
        except KeyboardInterrupt:
            if not record.waves:
                raise
            ended = "interrupted"
        return FoundCounts(record.places, record.cost, record.starts, record.found, ended)

    def _is_proved(self, cost: float) -> bool:
        """Whether no plan can be better than one of this cost."""
        if not np.isfinite(cost):
            return False
        return self.criterion.cost_from_plan_criterion(cost) * (1 - PROVED) <= self.bound

    def _patience(self) -> int:
        """Starts without an improvement after which the search ends."""
        pricing = self.pricing
        affordable = EFFORT / pricing.effort(self.limits)
        return int(np.clip(affordable, LEAST_STARTS, pricing.patience))

    def _wave(self, seed: int, number: int, size: int) -> tuple[Array, Indices]:
        """Costs (b,) of the plans from some starts, and their places (b, m)."""
        rng = np.random.default_rng((seed, number))
        starts = [self._start(rng, number == 0, i) for i in range(size)]
        own = [self.pricing.search_from(rng, start, RIDGE) for start in starts]
        if own[0] is not None:
            places = np.array(own)
            return self._costs(places), places
        guide = self.pricing.guide if number % 2 == 0 else None
        places = self._improved(np.array(starts), RIDGE, guide)
        scores = self.pricing.scores(places, RIDGE)
        together = min(self.pricing.kicks, max(1, self.pricing.together // size))
        for _ in range(self.pricing.kicks // together):
            n = self.pricing.candidates
            trials = kicked(rng, self.limits, np.repeat(places, together, axis=0), n)
            trials = self._improved(trials, RIDGE, guide)
            reached = self.pricing.scores(trials, RIDGE).reshape(size, together)
            best = reached.argmin(axis=1)
            each = np.arange(size)
            better = reached[each, best] <= scores
            trials = trials.reshape(size, together, -1)[each, best]
            places[better] = trials[better]
            scores[better] = reached[each, best][better]
        costs = self._costs(places)
        regular = np.isfinite(costs) & self._has_inverse(places)
        if regular.any():
            places[regular] = self._improved(places[regular], 0.0)
            costs = self._costs(places)
        return costs, places

    def _start(self, rng: np.random.Generator, first: bool, number: int) -> Indices:
        """Places (m,) to start from: rounded weights, then by weight and at random in turn."""
        n = self.pricing.candidates
        total = float(self.relaxed.sum())
        if not total or number % 2:
            return draw_places(rng, self.limits, np.ones(n))
        if first and number == 0 and not self.limits.restricts:
            places = np.repeat(np.arange(n), apportion(self.relaxed, self.limits.m))
            return rng.permutation(places)
        return draw_places(rng, self.limits, self.relaxed + 1e-3 * total / n)

    def _improved(self, places: Indices, ridge: float, guide: Pricing | None = None) -> Indices:
        """Plans (b, m) that no exchange of one place improves, after those for a guide."""
        if guide is not None:
            places = descend_places(guide, self.limits, places, ridge)
        places = descend_places(self.pricing, self.limits, places, ridge)
        if not self.limits.blocks:
            return places
        swapped = swap_between_blocks(self.criterion.plan_criterion, self.scatter, places)
        return descend_places(self.pricing, self.limits, swapped, ridge)

    def _has_inverse(self, places: Indices) -> Mask:
        """Which plans (b, m) have an inverse from which prices can be taken.

        A criterion of some combinations may be finite, and the best, where there is none.
        """
        if self.criterion.needs_all:
            return np.ones(len(places), dtype=bool)
        return guarded_inverse(self.scatter.information(places), ACCURATE)[2]

    def _costs(self, places: Indices) -> Array:
        """Costs (b,) of plans (b, m)."""
        M = self.scatter.information(places)
        costs = np.asarray(self.criterion.plan_criterion.cost(M)).reshape(-1)
        return np.where(np.isnan(costs), np.inf, costs)


class _Record:
    """The best plan so far."""

    places: Indices

    def __init__(self) -> None:
        self.cost = np.inf
        self.waves = 0
        self.starts = 0
        self.improved = 0
        self.found = 0

    def enter(self, costs: Array, places: Indices) -> None:
        """Enter the plans of a wave: costs (b,) and places (b, m)."""
        best = int(costs.argmin())
        if not self.waves or costs[best] < self.cost * (1 - SAME):
            self.improved = self.starts + len(costs)
            self.found = 0
        if not self.waves or costs[best] < self.cost:
            self.cost = float(costs[best])
            self.places = places[best]
        self.waves += 1
        self.starts += len(costs)
        if np.isfinite(self.cost):
            self.found += int((costs <= self.cost * (1 + SAME)).sum())
