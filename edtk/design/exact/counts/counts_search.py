"""Many descents from many starts, the best plan of them, and how often it was found."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from criteria import Criterion
from criteria.linalg.inverse import guarded_inverse
from edtk.design.exact.apportion import apportion
from edtk.design.exact.counts.counts_bound import Scatter
from edtk.design.exact.counts.joint_exchanges import (
    KINDS,
    exchange_jointly,
    kicked_jointly,
    nearest_plans,
    swap_between_blocks,
)
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.prices import GAIN, Pricing, first_lowest, first_of_largest
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices, Mask

KICKED = 0.2  # part of the places that a kick draws anew; two at least
LEAST_KICKED = 2
# Chances that are drawn from together; such arrays stay in a core's cache.
CHANCES_AT_ONCE = 200_000
SWEEPS = 100  # over all places, at most, in each round: some ten are usual
# Part of the candidates' mean information that is added to every plan at first, so that a singular
# start has prices: far below what a plan of so many places tells, far above rounding.
RIDGE = 1e-6
ACCURATE = 1e-8  # least eigenvalue at unit diagonal of a plan whose inverse has half its digits
SAME_COST = 1e-9  # relative difference of costs up to which two plans are equally good
PROVED = 1e-9  # relative distance to the bound at which nothing is left to find
EFFORT = 1e10  # products that the starts may take which bring no improvement
LEAST_STARTS = 4  # of them
# Part of that effort after which a search ends whose starts have all led to a few optima.
SETTLED = 0.1
UNSEEN = 0.5  # optima that may be expected beyond those
DRAWN_ANEW = 3  # places of the best plan that are drawn anew where it is a start
MOST_WAVES = 1024


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
    if limits.linear is not None:
        drawn = np.array([rng.choice(n, size=limits.m, p=own / own.sum()) for own in chances])
        return rng.permuted(nearest_plans(limits, n, drawn), axis=1)
    order = rng.random((len(chances), limits.m)).argsort(axis=1)
    places = np.tile(_cheapest(limits, n), (len(chances), 1))
    if limits.blocks:
        # Where the limits leave nothing to draw, what is left is who is in which block.
        places = rng.permuted(places, axis=1)
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
        places = _redrawn(rng, limits, places, some, [np.ones(n)] * len(places))
        if limits.linear is not None:
            places = kicked_jointly(rng, limits, places, n, number)
        return places
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
    together = max(1, CHANCES_AT_ONCE // n)
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
    return np.repeat(order, limits.largest(n)[order].astype(int))[: limits.m]


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
            better = (gain > prices.part).nonzero()[0]
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


@dataclass(frozen=True, eq=False)
class FoundPlaces:
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
        telling: How they are priced by the determinant: plans that leave parameters open come to
            tell them.
        relaxed: Counts (n,) of the relaxation; zeros where there is none.
        bound: No plan costs less.
    """

    criterion: Criterion
    scatter: Scatter
    pricing: Pricing
    telling: Pricing
    relaxed: Array
    bound: float

    @property
    def limits(self) -> Limits:
        """What a plan must obey."""
        return self.scatter.limits

    def run(
        self, seed: int, starts: int | None, progress: Callable[[int, float], object]
    ) -> FoundPlaces:
        """Search from so many starts, or until as many again as it took bring nothing better.

        Wave after wave depends on the seed and its number alone.
        """
        patience = self._patience()
        most = MOST_WAVES * self.pricing.wave if starts is None else starts
        # A wave of long searches shall not hold more starts than are worth it.
        wave = min(self.pricing.wave, patience) if starts is None else self.pricing.wave
        record = Record()

        def enter(size: int) -> str:
            around = self._around(record)
            record.enter(self._wave(seed, record.waves, size, around), around is None)
            progress(record.starts, record.cost)
            if self._is_proved(record.cost):
                return "proved"
            is_over = record.is_idle(patience) or self._is_settled(record)
            return "stagnation" if starts is None and is_over else ""

        return record.filled(enter, wave, most)

    def _is_proved(self, cost: float) -> bool:
        """Whether no plan can be better than one of this cost."""
        if not np.isfinite(cost):
            return False
        return self.criterion.cost_from_plan_criterion(cost) * (1 - PROVED) <= self.bound

    def _patience(self) -> int:
        """Starts without an improvement after which the search ends."""
        pricing = self.pricing
        affordable = EFFORT / self._effort()
        return int(np.clip(affordable, LEAST_STARTS, pricing.patience))

    def _effort(self) -> float:
        """About how many products a start takes, exchanges of two places included."""
        limits = self.limits
        one = self.pricing.effort(limits)
        return one if limits.linear is None else one * (1 + KINDS * limits.m)

    def _is_settled(self, record: "Record") -> bool:
        """Whether long searches have most likely seen all optima that starts lead to.

        Of w optima that s starts have led to, the expected number of others is
        ``w (w + 1) / (s - w - 2)`` (Boender and Rinnooy Kan 1987).
        """
        affordable = SETTLED * EFFORT / self._effort()
        if record.starts < affordable or not np.isfinite(record.cost):
            return False
        w = record.optima
        return w * (w + 1) < UNSEEN * (len(record.drawn) - w - 2)

    def _around(self, record: "Record") -> Indices | None:
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
        few = None if around is None else DRAWN_ANEW
        if around is None:
            starts = self._starts(rng, number == 0, size)
        else:
            starts = kicked(rng, self.limits, np.tile(around, (size, 1)), n, few)
        own = [self.pricing.search_from(rng, start, RIDGE) for start in starts]
        if own[0] is not None:
            places = np.array(own)
            if self._are_regular(places).all() or not self.criterion.needs_all:
                return self._costs(places), places
            return self._settled(rng, places)
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
            best = first_of_largest(-reached, np.abs(reached).min(axis=1))
            each = np.arange(size)
            better = reached[each, best] <= scores + GAIN * np.abs(scores)
            trials = trials.reshape(size, together, -1)[each, best]
            places[better] = trials[better]
            scores[better] = reached[each, best][better]
        return self._settled(rng, places)

    def _settled(self, rng: np.random.Generator, places: Indices) -> tuple[Array, Indices]:
        """Costs (b,) and places (b, m) of plans, improved without a ridge where that may be.

        Beside a ridge a plan may give up a parameter that counts nothing in the criterion, such as
        a spring where the tasks have no load. A cost that needs all of them is infinite then, and
        what such a plan spends may leave nothing for the exchange that tells it. So it is drawn
        anew, with all candidates alike, and improved for the determinant first.
        """
        regular = self._are_regular(places)
        if self.criterion.needs_all and not regular.all():
            alike = np.ones((int((~regular).sum()), self.pricing.candidates))
            drawn = draw_places(rng, self.limits, list(alike))
            places[~regular] = descend_places(self.telling, self.limits, drawn, RIDGE)
            regular = self._are_regular(places)
        if regular.any() and not out_of_time():
            places[regular] = self._improved(places[regular], 0.0)
            if self.limits.linear is not None:
                places[regular] = self._improved_jointly(places[regular])
        return self._costs(places), places

    def _are_regular(self, places: Indices) -> Mask:
        """Which plans (b, m) have prices without a ridge."""
        return np.isfinite(self._costs(places)) & self._has_inverse(places)

    def descended(self, places: Indices) -> tuple[Indices, Mask]:
        """Places (b, m) after exchanges, and which plans are regular: none improves these."""
        places = places.copy()
        # A plan that tells far more than a ridge needs no descent beside one first.
        regular = guarded_inverse(self.scatter.information(places), RIDGE)[2]
        if not regular.all():
            places[~regular] = self._improved(places[~regular], RIDGE)
            regular[~regular] = self._are_regular(places[~regular])
        places[regular] = self._improved(places[regular], 0.0)
        return places, regular

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

    def _improved_jointly(self, places: Indices) -> Indices:
        """Plans (b, m) that no exchange of two places improves; equal ones share the work."""
        limits = self.limits
        if limits.blocks:
            return self._improved(exchange_jointly(self.pricing, limits, places), 0.0)
        _, first, back = np.unique(
            np.sort(places, axis=1), axis=0, return_index=True, return_inverse=True
        )
        own = exchange_jointly(self.pricing, limits, places[first])
        return self._improved(own, 0.0)[back.ravel()]

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


class Record:
    """The best plan so far, of a search that goes on wave by wave of starts."""

    def __init__(self) -> None:
        self.places: Indices | None = None
        self.drawn = np.empty(0)
        self.cost = np.inf
        self.waves = 0
        self.starts = 0
        self.improved = 0
        self.found = 0

    def filled(self, enter: Callable[[int], str], wave: int, most: int) -> FoundPlaces:
        """Enter waves until the search ends; without time, or after Ctrl-C, what is found is told.

        Args:
            enter: Searches from so many starts, enters them, and says why the search ends; "" if it
                goes on.
            wave: Starts of a wave.
            most: Starts in all.
        """
        ended = ""
        try:
            while not ended and self.starts < most:
                ended = enter(min(wave, most - self.starts))
                if ended != "proved" and out_of_time():
                    ended = "budget"
        except KeyboardInterrupt:
            if self.places is None:
                raise
            ended = "interrupted"
        assert self.places is not None
        return FoundPlaces(self.places, self.cost, self.starts, self.found, ended or "starts")

    def is_idle(self, patience: int) -> bool:
        """Whether so many starts, and as many as it took, have brought no improvement."""
        return self.starts - self.improved >= max(patience, self.starts // 2)

    @property
    def optima(self) -> int:
        """How many costs the plans from drawn starts have."""
        ordered = np.sort(self.drawn[np.isfinite(self.drawn)])
        return 1 + int((np.diff(ordered) > SAME_COST * ordered[1:]).sum())

    def enter(self, found: tuple[Array, Indices], drawn: bool) -> None:
        """Enter costs (b,) and places (b, m) of a wave, and whether its starts were drawn anew."""
        costs, places = found
        if drawn:
            self.drawn = np.append(self.drawn, costs)
        best = first_lowest(costs)
        if not self.waves or costs[best] < self.cost * (1 - SAME_COST):
            self.improved = self.starts + len(costs)
            self.found = 0
        if not self.waves or costs[best] < self.cost * (1 - GAIN):
            self.cost = float(costs[best])
            self.places = places[best]
        self.waves += 1
        self.starts += len(costs)
        if np.isfinite(self.cost):
            as_good = int((costs <= self.cost * (1 + SAME_COST)).sum())
            self.found = self.found + as_good if drawn else max(1, self.found)
