"""Exchanges of two places at once: what single exchanges cannot reach under equations or in blocks.

An equation leaves few exchanges of one place, or none. Two places that change together can keep it;
whole plans that do are the nearest ones to a drawn plan. Two experiments of different blocks swap,
priced by low-rank updates of the information.
"""

from dataclasses import replace

import numpy as np

from criteria import Criterion
from criteria.linalg.inverse import guarded_inverse
from edtk.design.exact.counts.counts_bound import Scatter
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.prices import GAIN, Pricing, first_of_largest
from edtk.design.exact.exchange_costs import UPDATABLE, trade_costs
from edtk.design.linear_constraints import LinearConstraints, solved
from edtk.system.errors import UserError
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices, Mask

KINDS = 8  # kinds of candidates, the best one of each, that are tried at the first of two places
JOINT_SWEEPS = 20  # over all places, at most
TRIES = 8  # second places that a random exchange tries
REPAIRS = 4  # of counts that a solver takes for within limits
TOLERANCE = 1e-5  # room, relative, that a sum beyond its limit loses
# Part of the mean information that is added to plans whose first exchange may leave them singular.
LEAST_RIDGE = 1e-9
SWAP_SWEEPS = 50  # over all places, at most


def nearest_plans(limits: Limits, n: int, drawn: Indices) -> Indices:
    """The plans (b, m) within limits whose counts are nearest to those of plans (b, m) as drawn.

    The sum of all differences of counts is least: a program in whole numbers. Places where the
    counts agree keep their candidates.
    """
    targets = limits.counts(drawn, n)
    found = np.array([nearest_counts(limits, target) for target in targets])
    rest = limits.m - found.sum(axis=1)
    every = np.arange(n + 1)
    return np.array(
        [np.repeat(every, np.append(own, empty)) for own, empty in zip(found, rest, strict=True)]
    )


def nearest_counts(limits: Limits, target: Array) -> Indices:
    """Whole counts (n,) within limits that differ least from a target (n,).

    Solvers take a sum for obeyed that is not by a ten-millionth. Such a sum gets less room.

    Raises:
        UserError: None were found.
    """
    n = len(target)
    rows = limits.rows(n)
    for _ in range(REPAIRS):
        counts = _nearest_by_program(rows, limits.largest(n), target)
        if counts is None:
            break
        places = np.repeat(np.arange(n + 1), np.append(counts, limits.m - counts.sum()))
        beyond = limits.beyond(places[None])[:, 0]
        if not beyond.any():
            return counts
        room = TOLERANCE * np.maximum(np.abs(rows.high[: len(beyond)]), 1.0)
        high = np.append(rows.high[: len(beyond)] - beyond * room, rows.high[len(beyond) :])
        rows = replace(rows, high=high)
    raise UserError("no whole counts within all limits were found")


def _nearest_by_program(rows: LinearConstraints, most: Array, target: Array) -> Indices | None:
    """The counts (n,) of a program in whole numbers; None where it has no solution."""
    from scipy.optimize import Bounds, LinearConstraint
    from scipy.sparse import csr_array, eye_array, hstack, vstack

    n = len(target)
    own = eye_array(n)
    differences = vstack([hstack([own, -own]), hstack([-own, -own])])
    sums = hstack([csr_array(rows.C), csr_array((len(rows), n))])
    found = solved(
        np.concatenate([np.zeros(n), np.ones(n)]),
        np.concatenate([np.ones(n), np.zeros(n)]),
        Bounds(0.0, np.concatenate([most, np.full(n, np.inf)])),
        [
            LinearConstraint(differences, -np.inf, np.concatenate([target, -target])),
            LinearConstraint(sums, rows.low, rows.high),
        ],
    )
    return None if found is None else np.asarray(np.round(found[:n]).astype(int))


def kicked_jointly(
    rng: np.random.Generator, limits: Limits, places: Indices, n: int, number: int
) -> Indices:
    """Plans (b, m) after some random exchanges of two places at once, within the limits."""
    for _ in range(number):
        trials = places.copy()
        first = rng.integers(limits.m, size=len(places))
        _take_any(rng, limits.apart, trials, first, n)
        open_ = np.arange(len(places))
        for _ in range(TRIES):
            second = (first[open_] + rng.integers(1, max(limits.m, 2), size=len(open_))) % limits.m
            own = trials[open_]
            fits = _take_any(rng, limits, own, second, n)
            done = open_[fits]
            places = places.copy()
            places[done] = own[fits]
            open_ = open_[~fits]
            if not len(open_):
                break
    return places


def _take_any(
    rng: np.random.Generator, limits: Limits, places: Indices, place: Indices, n: int
) -> Mask:
    """Put an allowed candidate into a place (b,) of plans (b, m), which change; where it was."""
    each = np.arange(len(places))
    allowed = limits.allowed(places, place, n)
    if allowed is None:
        allowed = np.ones((len(places), n), dtype=bool)
    waits = np.where(allowed, rng.random(allowed.shape), np.inf)
    new = waits.argmin(axis=1)
    done = np.isfinite(waits[each, new])
    places[each[done], place[done]] = new[done]
    return np.asarray(done)


def exchange_jointly(pricing: Pricing, limits: Limits, places: Indices) -> Indices:
    """Improve plans by exchanging two places at once, as long as that helps.

    The first place takes the best candidate of a kind, whatever becomes of the sums; the second one
    then takes the best candidate that brings them back within their limits.

    Args:
        pricing: Prices of the criterion.
        limits: What plans must obey; the given ones do.
        places: Candidates (b, m) at the places of b plans.

    Returns:
        Places (b, m) of plans that are no worse.
    """
    places = places.copy()
    size = max(1, pricing.batch // KINDS)
    for first in range(0, len(places), size):
        part = slice(first, first + size)
        for _ in range(JOINT_SWEEPS):
            moved = _swept(pricing, limits, places[part], LEAST_RIDGE)
            if not moved or out_of_time():
                break
    return places


def _swept(pricing: Pricing, limits: Limits, places: Indices, ridge: float) -> bool:
    """Try each place of plans (b, m), which change, as the first of two; whether one has moved."""
    scores = pricing.scores(places, ridge)
    moved = False
    for place in range(places.shape[1]):
        whose, trials = _first_exchanged(pricing, limits, places, place, ridge)
        if not len(whose):
            continue
        valid, trials = _second_exchanged(pricing, limits, trials, place, ridge)
        reached = np.full(len(whose), np.inf)
        if valid.any():
            reached[valid] = pricing.scores(trials[valid], ridge)
        for b in np.unique(whose):
            own = np.flatnonzero(whose == b)
            best = own[reached[own].argmin()]
            if reached[best] < scores[b] - GAIN * max(1.0, abs(scores[b])):
                places[b] = trials[best]
                scores[b] = reached[best]
                moved = True
    return moved


def _first_exchanged(
    pricing: Pricing, limits: Limits, places: Indices, place: int, ridge: float
) -> tuple[Indices, Indices]:
    """Plans (t, m) with the best candidate of some kinds at a place, and whose they are (t,)."""
    n = pricing.candidates
    each = np.arange(len(places))
    prices = pricing.prices(places, ridge, pricing.rounds[-1])
    allowed = limits.apart.allowed(places, place, n)
    width = n if limits.sized else n + 1
    left = np.ones((len(places), width), dtype=bool) if allowed is None else allowed
    kinds = limits.kinds.of[:width]
    left &= kinds != limits.kinds.of[places[:, place]][:, None]
    whose = []
    trials = []
    for _ in range(min(KINDS, limits.kinds.columns.shape[1])):
        some = left.any(axis=1)
        if not some.any():
            break
        new, gain = prices.best(place, left)
        some &= left[each, new] & np.isfinite(gain)
        own = places[some].copy()
        own[:, place] = new[some]
        whose.append(each[some])
        trials.append(own)
        left &= kinds != kinds[new][:, None]
    return np.concatenate([each[:0], *whose]), np.concatenate([places[:0], *trials])


def _second_exchanged(
    pricing: Pricing, limits: Limits, trials: Indices, first: int, ridge: float
) -> tuple[Mask, Indices]:
    """Plans (t, m) whose best second exchange obeys the limits, and which have one (t,)."""
    each = np.arange(len(trials))
    prices = pricing.prices(trials, ridge, pricing.rounds[-1])
    gains = np.full(len(trials), -np.inf)
    found = trials.copy()
    for place in range(trials.shape[1]):
        if place == first:
            continue
        allowed = limits.allowed(trials, place, pricing.candidates)
        assert allowed is not None
        if not allowed.any():
            continue
        new, gain = prices.best(place, allowed)
        gain = np.where(allowed[each, new], gain, -np.inf)
        better = gain > gains
        gains[better] = gain[better]
        found[better] = trials[better]
        found[better, place] = new[better]
    return np.isfinite(gains), found


def swap_between_blocks(criterion: Criterion, scatter: Scatter, places: Indices) -> Indices:
    """Swap experiments of different blocks in each plan, as long as that improves it.

    Where every candidate may be taken once only, and all are, nothing else can improve a plan.

    Args:
        criterion: The criterion to minimise.
        scatter: Rows of the candidates, and the blocks.
        places: Candidates (b, m) at the places of b plans.

    Returns:
        Places (b, m) of plans that are no worse.
    """
    places = places.copy()
    left = np.arange(len(places))
    for _ in range(SWAP_SWEEPS):
        swaps = BlockSwaps(criterion, scatter, places[left])
        moved = np.zeros(len(left), dtype=bool)
        for place in range(places.shape[1]):
            moved[swaps.swap(place)] = True
        places[left] = swaps.places
        left = left[moved]
        if not len(left):
            break
    return places


class BlockSwaps:
    """Plans on their way, in which experiments of different blocks are swapped.

    Let s and t be the sums of the rows of two blocks, with shares a and b of `Limits.shares`. Where
    U of the first and V of the second are swapped, the sums become ``s + V - U`` and ``t + U - V``,
    and the information about the parameters changes by

        h (J'J - E'E)    with h = a + b, J = (b t - a s) / h and E = V - U - J.

    So a swap is a trade: rows J join, and rows E leave, both times the root of h.

    Args:
        criterion: The criterion to minimise.
        scatter: Rows of the candidates, and the blocks.
        places: Candidates (b, m) at the places of b plans.
    """

    def __init__(self, criterion: Criterion, scatter: Scatter, places: Indices) -> None:
        self.criterion = criterion
        self.scatter = scatter
        self.places = places.copy()
        self.M = scatter.information(places)
        self.costs = self._costs_of(self.M)
        _, self.cov, self.regular = guarded_inverse(self.M, UPDATABLE)

    def swap(self, place: int) -> Indices:
        """Swap the experiment at one place with the best one of another block.

        Returns:
            The plans (k,) that this improves; the others stay as they are.
        """
        costs = self.costs_at(place)
        best = first_of_largest(-costs, costs.min(axis=1))
        least = costs[np.arange(len(best)), best]
        which = (least < self.costs * (1 - GAIN)).nonzero()[0]
        return self._take_over(which, place, best[which]) if len(which) else which

    def costs_at(self, place: int) -> Array:
        """Costs (b, m) where a place is swapped with each other; inf with those of its block."""
        scatter = self.scatter
        shares, block_of = scatter.limits.shares, scatter.limits.block_of
        own = block_of[place]
        others = np.flatnonzero(block_of != own)
        h = (shares[own] + shares[block_of[others]])[:, None, None]
        pulls = shares[:, None, None] * scatter.sums(self.places)
        J = (pulls[:, block_of[others]] - pulls[:, own, None]) / h
        U = scatter.rows[self.places]
        E = U[:, others] - U[:, place, None] - J
        root = np.sqrt(h)
        inverse = self.cov, self.regular
        costs = np.full(self.places.shape, np.inf)
        costs[:, others] = trade_costs(self.criterion, self.M, inverse, root * J, root * E)
        return costs

    def _take_over(self, which: Indices, place: int, other: Indices) -> Indices:
        """Swap two places in plans (k,); information and costs are computed anew, without a drift.

        Returns:
            The plans that this improves indeed; the others stay as they are.
        """
        trials = self.places[which]
        each = np.arange(len(which))
        trials[each, other] = self.places[which, place]
        trials[:, place] = self.places[which, other]
        M = self.scatter.information(trials)
        costs = self._costs_of(M)
        better = costs < self.costs[which] * (1 - GAIN)
        which = which[better]
        self.places[which] = trials[better]
        self.costs[which] = costs[better]
        self.M[which] = M[better]
        _, self.cov[which], self.regular[which] = guarded_inverse(M[better], UPDATABLE)
        return which

    def _costs_of(self, M: Array) -> Array:
        """Costs (b,) of information (b, p, p)."""
        return np.asarray(self.criterion.cost(M)).reshape(-1)
