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
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices, Mask

# Part of the candidates' mean information that is added to every plan at first, so that a singular
# start has prices: far below what a plan of so many places tells, far above rounding.
RIDGE = 1e-6
ACCURATE = 1e-8  # least eigenvalue at unit diagonal of a plan whose inverse has half its digits
SAME = 1e-9  # relative difference of costs up to which two plans are equally good
PROVED = 1e-9  # relative distance to the bound at which nothing is left to find
EFFORT = 1e10  # products that the starts may take which bring no improvement
LEAST_STARTS = 4  # of them
# Part of that effort after which a search ends whose starts have all led to a few optima.
SETTLED = 0.1
UNSEEN = 0.5  # optima that may be expected beyond those
AROUND = 3  # places of the best plan that are drawn anew where it is a start
MOST_WAVES = 1024


@dataclass(frozen=True, eq=False)
class FoundCounts:
    """The best plan of a search.

    Attributes:
        places: Candidates (m,) at its places.
        cost: Its cost.
        starts: Number of starts.
        found: How many of them, the ones around the best plan left out, led to a plan as good.
        ended: Why the search ended: "starts", "stagnation", "proved", "budget" or "interrupted".
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
                around = self._around(record)
                record.enter(self._wave(seed, record.waves, size, around), around is None)
                progress(record.starts, record.cost)
                if self._is_proved(record.cost):
                    ended = "proved"
                    break
                if out_of_time():
                    ended = "budget"
                    break
                idle = record.starts - record.improved
                if starts is None and (
                    idle >= max(patience, record.starts // 2) or self._is_settled(record)
                ):
                    ended = "stagnation"
                    break
        except KeyboardInterrupt:
            if record.places is None:
                raise
            ended = "interrupted"
        assert record.places is not None
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

    def _is_settled(self, record: "_Record") -> bool:
        """Whether long searches have most likely seen all optima that starts lead to.

        Of w optima that s starts have led to, the expected number of others is
        ``w (w + 1) / (s - w - 2)`` (Boender and Rinnooy Kan 1987).
        """
        affordable = SETTLED * EFFORT / self.pricing.effort(self.limits)
        if record.starts < affordable or not np.isfinite(record.cost):
            return False
        w = record.optima
        return w * (w + 1) < UNSEEN * (len(record.drawn) - w - 2)

    def _around(self, record: "_Record") -> Indices | None:
        """The best plan (m,) so far where the next wave starts around it, as every other one does.

        Long searches of one start kick it themselves.
        """
        return record.places if record.waves % 2 and self.pricing.wave > 1 else None

    def _wave(
        self, seed: int, number: int, size: int, around: Indices | None
    ) -> tuple[Array, Indices]:
        """Costs (b,) of the plans from some starts, and their places (b, m).

        The starts are drawn, or are around a plan (m,), of which kicks then draw but a few places.
        """
        rng = np.random.default_rng((seed, number))
        n = self.pricing.candidates
        few = None if around is None else AROUND
        if around is None:
            starts = self._starts(rng, number == 0, size)
        else:
            starts = kicked(rng, self.limits, np.tile(around, (size, 1)), n, few)
        own = [self.pricing.search_from(rng, start, RIDGE) for start in starts]
        if own[0] is not None:
            places = np.array(own)
            return self._costs(places), places
        guide = self.pricing.guide if number % 2 == 0 else None
        places = self._improved(starts, RIDGE, guide)
        scores = self.pricing.scores(places, RIDGE)
        together = min(self.pricing.kicks, max(1, self.pricing.together // size))
        for _ in range(self.pricing.kicks // together):
            if out_of_time():
                break
            trials = kicked(rng, self.limits, np.repeat(places, together, axis=0), n, few)
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
        if regular.any() and not out_of_time():
            places[regular] = self._improved(places[regular], 0.0)
            costs = self._costs(places)
        return costs, places

    def _starts(self, rng: np.random.Generator, first: bool, size: int) -> Indices:
        """Places (b, m) to start from: rounded weights, then by weight and at random in turn."""
        n = self.pricing.candidates
        total = float(self.relaxed.sum())
        alike = np.ones(n)
        by_weight = self.relaxed + 1e-3 * total / n if total else alike
        chances = [alike if i % 2 else by_weight for i in range(size)]
        starts = draw_places(rng, self.limits, chances)
        if total and first and not self.limits.restricts:
            places = np.repeat(np.arange(n), apportion(self.relaxed, self.limits.m))
            starts[0] = rng.permutation(places)
        return starts

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

    def __init__(self) -> None:
        self.places: Indices | None = None
        self.drawn = np.empty(0)
        self.cost = np.inf
        self.waves = 0
        self.starts = 0
        self.improved = 0
        self.found = 0

    @property
    def optima(self) -> int:
        """How many costs the plans from drawn starts have."""
        ordered = np.sort(self.drawn[np.isfinite(self.drawn)])
        return 1 + int((np.diff(ordered) > SAME * ordered[1:]).sum())

    def enter(self, found: tuple[Array, Indices], drawn: bool) -> None:
        """Enter costs (b,) and places (b, m) of a wave, and whether its starts were drawn anew."""
        costs, places = found
        if drawn:
            self.drawn = np.append(self.drawn, costs)
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
            as_good = int((costs <= self.cost * (1 + SAME)).sum())
            self.found = self.found + as_good if drawn else max(1, self.found)
