"""Exchange: the best m of many candidates, one place of a plan after another."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from criteria import Criterion
from criteria.linalg.inverse import guarded_inverse
from edtk.design.exact.apportion import GAIN_OF_MOVE
from edtk.design.exact.counts.any_prices import GUIDE_SHARPNESS, AnyPricing
from edtk.design.exact.counts.counts_search import CountsSearch
from edtk.design.exact.counts.limits import Limits
from edtk.design.exact.counts.prices import first_few_largest, first_of_largest
from edtk.design.exact.counts.pricing_for import search_for
from edtk.design.exact.exchange_costs import UPDATABLE, CandidatePrices, exchange_costs
from edtk.design.problem import Problem
from edtk.design.problems import absorb_prior
from edtk.system.arguments import checked
from edtk.system.errors import ArgumentError, UserError, finite_numbers, real_numbers
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices, Mask

# Their matrices, of some megabytes, stay in a core's cache, and take no second of many parameters.
EXCHANGES_AT_ONCE = 20_000
DOUBLES_AT_ONCE = 2**20
# Part of the candidates' mean information that is added for each measurement of a plan whose
# singularity no single exchange ends: far below what a plan tells, far above rounding.
RIDGE = 1e-6


@checked
def exchange(
    problem: Problem,
    criterion: Criterion,
    start: ArrayLike,
    repeats: ArrayLike | None = None,
    shortlists: Sequence[int] = (16, 64),
    thorough: bool = True,
) -> tuple[Indices, Array]:
    """Improve plans by exchanging one place after another for a better candidate.

    Where each experiment has one row and is measured once, the places take the best of all
    candidates in turn, as long as that helps: Cook and Nachtsheim's modified Fedorov algorithm.

    Elsewhere this is Fedorov's exchange algorithm with short lists (Atkinson and Donev's KL). Each
    round computes the cost of every exchange of a place for a candidate of large sensitivity, and
    makes the best one. Only when none helps, a longer list is tried, and all candidates at last.
    Many plans may be improved at once: they are independent and share their array operations.

    Args:
        problem: The candidates, and the prior information if there is any.
        criterion: The criterion to improve. From a singular start, where no single exchange makes
            the plan regular, several are made at first with a little of every candidate added.
        start: Indices of the candidates at the k places (..., k); a candidate may occur twice.
        repeats: Numbers of measurements at each place (..., k), which are kept; default to one.
        shortlists: Numbers of candidates of largest sensitivity that are tried first, then next.
        thorough: Whether all candidates are tried at last, so that no single exchange improves the
            result. For a singular plan all are tried in any case.

    Returns:
        Indices of the candidates by place (..., k), and the costs of the plans (...); of several
        plans, those that stay singular have infinite cost.

    Raises:
        UserError: A single plan stays singular: so few places cannot identify what is needed.
        ArgumentError: An argument is not of this kind.

    Example:
        The best two of eleven points for a straight line are its ends.

        >>> import numpy as np, edtk
        >>> x = np.linspace(-1.0, 1.0, 11)
        >>> line = edtk.Problem(np.column_stack([np.ones(11), x])[:, None, :])
        >>> places, cost = edtk.exchange(line, edtk.criteria.create("D"), start=[4, 5])
        >>> sorted(x[places].tolist())
        [-1.0, 1.0]
    """
    first = _indices(start, problem.n)
    times = _times(repeats, first.shape).reshape(-1, first.shape[-1])
    places = first.reshape(times.shape)
    problem, criterion = absorb_prior(problem, criterion, _size(times, criterion))
    found, settled = _settled(problem, criterion, places, times, thorough)
    left = np.flatnonzero(~settled)
    costs = np.asarray(criterion.cost(problem.plan_information(found, times))).reshape(-1)
    if len(left):
        found[left], costs[left] = _exchanged(
            problem, criterion, found[left], times[left], shortlists, thorough
        )
    stuck = ~np.isfinite(costs)
    if stuck.all() or (stuck.any() and not out_of_time()):
        ridge = RIDGE * problem.mean
        ridged = problem.with_prior(ridge if problem.prior is None else problem.prior + ridge)
        some = places[stuck], times[stuck]
        again, _ = _exchanged(ridged, criterion, *some, shortlists, thorough)
        found[stuck], costs[stuck] = _exchanged(
            problem, criterion, again, times[stuck], shortlists, thorough
        )
    if first.ndim == 1 and not np.isfinite(costs[0]):
        raise UserError(
            f"no plan of {len(first)} places was found that identifies what {criterion.label} needs"
        )
    return found.reshape(first.shape), costs.reshape(first.shape[:-1])[()]


def _indices(start: ArrayLike, n: int) -> Indices:
    """Indices of n candidates (..., k).

    Raises:
        ArgumentError: They are none.
    """
    given = real_numbers(start, "start")
    if not given.ndim or not given.size or not ((given >= 0) & (given < n)).all():
        message = f"expected indices of candidates, from 0 to {n - 1}, one or more"
        raise ArgumentError(message, argument="start")
    found = given.astype(int)
    if (found != given).any():
        raise ArgumentError("expected whole numbers", argument="start")
    return found


def _times(repeats: ArrayLike | None, shape: tuple[int, ...]) -> Array:
    """How often each place is measured (..., k).

    Raises:
        ArgumentError: They are no such numbers.
    """
    if repeats is None:
        return np.ones(shape)
    given = finite_numbers(repeats, "repeats")
    try:
        times = np.broadcast_to(given, shape)
    except ValueError as error:
        message = f"of shape {given.shape}; expected one number for each place, {shape}"
        raise ArgumentError(message, argument="repeats") from error
    if not (times >= 0).all():
        raise ArgumentError("expected numbers from zero", argument="repeats")
    return times


def _size(times: Array, criterion: Criterion) -> float:
    """Number of experiments of each plan, of which every one has its share of a prior.

    Raises:
        UserError: Plans of different sizes would have different shares.
    """
    sizes = times.sum(axis=1)
    if criterion.precision is not None and (sizes != sizes[0]).any():
        raise UserError(f"plans under {criterion.label} share a prior; expected plans of one size")
    return float(sizes[0]) if len(sizes) else 1.0


def _settled(
    problem: Problem, criterion: Criterion, places: Indices, times: Array, thorough: bool
) -> tuple[Indices, Mask]:
    """Places (b, k) of plans after exchanges in turn, and which plans (b,) none improves any more.

    All are as given where prices of exchanges in turn do not suit; those that tell too little for
    such prices are left to others.
    """
    # Rows of many models are mostly zeros, which only prices in turn leave out.
    search = _in_turn(problem, criterion, times) if thorough or len(problem.models) > 1 else None
    if search is None:
        return places.copy(), np.zeros(len(places), dtype=bool)
    return search.descended(places)


def _in_turn(problem: Problem, criterion: Criterion, times: Array) -> CountsSearch | None:
    """What exchanges the places of plans (b, k) in turn; None where its prices do not suit."""
    several_rows = any(one.factors().shape[1] > 1 for one in problem.each)
    if not times.size or (times != 1.0).any() or several_rows:
        return None
    if not guarded_inverse(problem.mean, UPDATABLE)[2].all():
        return None
    m = times.shape[1]
    base = np.zeros((problem.p, problem.p)) if problem.prior is None else m * problem.prior
    search = search_for(problem.with_prior(None), criterion, Limits(m, base), None, thorough=True)
    return None if type(search.pricing) is AnyPricing else search


def _exchanged(
    problem: Problem,
    criterion: Criterion,
    places: Indices,
    times: Array,
    shortlists: Sequence[int],
    thorough: bool,
) -> tuple[Indices, Array]:
    """Places (b, k) and costs (b,) of plans that no exchange improves."""
    prices = CandidatePrices.of(criterion, problem)
    search = _Search(problem, criterion, criterion.smoothed(GUIDE_SHARPNESS), times, prices)
    plans = search.plans_of(places, times)
    # Where a look at all candidates costs no more than one at a few, the best exchange is made.
    sizes = [size for size in shortlists if size < problem.n and prices is None]
    thorough = thorough or not sizes
    left = np.arange(len(times))
    while len(left):
        # Without time one plan that tells all is enough.
        if out_of_time() and np.isfinite(plans.costs).any():
            break
        plans, left = search.round(plans, left, sizes, thorough)
    return plans.places, plans.costs


@dataclass(frozen=True, eq=False)
class _Plans:
    """Plans on their way.

    Attributes:
        places: Indices of candidates (b, k).
        M: Information matrices (b, p, p).
        costs: Costs (b,).
    """

    places: Indices
    M: Array
    costs: Array

    def replaced(self, which: Indices, others: "_Plans") -> "_Plans":
        """The same plans, some of them replaced by others in the order of `which`."""
        # The caller keeps its arrays: a copy costs little beside a look at the candidates.
        places = self.places.copy()
        M = self.M.copy()
        costs = self.costs.copy()
        places[which] = others.places
        M[which] = others.M
        costs[which] = others.costs
        return _Plans(places, M, costs)

    def __getitem__(self, chosen: Indices) -> "_Plans":
        """The chosen plans."""
        return _Plans(self.places[chosen], self.M[chosen], self.costs[chosen])


@dataclass(frozen=True, eq=False)
class _Search:
    """The parts of an exchange that stay the same.

    Attributes:
        problem: The candidates.
        criterion: The criterion to improve.
        guide: A smooth criterion near it, whose gradient ranks the candidates.
        times: Repetitions (b, k) of the places.
        prices: The quickest way to the costs of all exchanges, if there is one.
    """

    problem: Problem
    criterion: Criterion
    guide: Criterion
    times: Array
    prices: CandidatePrices | None

    def plans_of(self, places: Indices, times: Array) -> _Plans:
        """The plans at places (b, k), with repetitions."""
        M = self.problem.plan_information(places, times)
        return _Plans(places, M, np.asarray(self.criterion.cost(M)).reshape(-1))

    def round(
        self, plans: _Plans, left: Indices, sizes: Sequence[int], thorough: bool
    ) -> tuple[_Plans, Indices]:
        """Exchange one place in each plan that is left, and return those that became better.

        A plan that a short list improves waits for the next round, which begins with short lists
        again: the cost of a look at all candidates is paid only when they are exhausted.
        """
        improved = [left[:0]]
        for size in (*sizes, self.problem.n):
            everything = size == self.problem.n
            regular = np.isfinite(plans.costs[left])
            # A singular plan has no gradient, and therefore no short list.
            tried = left[~regular | thorough] if everything else left[regular]
            if len(tried):
                plans, better = self._improve(plans, tried, size)
                improved.append(better)
                left = np.setdiff1d(left, better)
        return plans, np.concatenate(improved)

    def _improve(self, plans: _Plans, some: Indices, size: int) -> tuple[_Plans, Indices]:
        """Make the best exchange in some plans, and return which of these became better."""
        before = plans[some]
        times = self.times[some]
        candidates = self._shortlists(before, size)
        after = self.plans_of(self._best_exchanges(before, times, candidates), times)
        better = np.flatnonzero(after.costs < before.costs * (1 - GAIN_OF_MOVE))
        return plans.replaced(some[better], after[better]), some[better]

    def _shortlists(self, plans: _Plans, size: int) -> Indices:
        """Candidates (b, size) of largest sensitivity for each plan, or all of them."""
        n = self.problem.n
        if size == n:
            return np.broadcast_to(np.arange(n), (len(plans.costs), n))
        sensitivities = self.problem.sensitivities(-self.guide.gradient(plans.M))
        return first_few_largest(sensitivities, size)

    def _best_exchanges(self, plans: _Plans, times: Array, candidates: Indices) -> Indices:
        """Places (b, k) after the best exchange with one of each plan's candidates (b, n)."""
        problem = self.problem
        changed = plans.places.copy()
        least = np.full(len(changed), np.inf)
        of, place = _different_places(plans.places, times)
        r = times[of, place]
        rest = plans.M[of] - r[:, None, None] * problem.blocks(plans.places[of, place])
        if self.prices is not None:
            costs = np.full((*changed.shape, problem.n), np.inf)
            costs[of, place] = self.prices.costs(rest, r)
            flat = costs.reshape(len(changed), -1)
            where, which = np.divmod(first_of_largest(-flat, flat.min(axis=1)), problem.n)
            changed[np.arange(len(changed)), where] = which
            return changed
        width = candidates.shape[1]
        at_once = min(EXCHANGES_AT_ONCE, DOUBLES_AT_ONCE // problem.p**2 + 1)
        parts = min(width, max(1, width * len(of) // at_once))
        for part in np.array_split(candidates, parts, axis=1):
            # Plans that tell all need no exchange.
            if out_of_time() and np.isfinite(plans.costs).all():
                break
            # Places that are not tried keep an infinite cost, and are never the best.
            costs = np.full((*changed.shape, part.shape[1]), np.inf)
            costs[of, place] = exchange_costs(self.criterion, rest, problem.factors(part)[of], r)
            flat = costs.reshape(len(changed), -1)
            lowest = flat.min(axis=1)
            where, which = np.divmod(first_of_largest(-flat, lowest), part.shape[1])
            better = np.flatnonzero(lowest < least * (1 - GAIN_OF_MOVE))
            changed[better] = plans.places[better]
            changed[better, where[better]] = part[better, which[better]]
            least[better] = lowest[better]
        return changed


def _different_places(places: Indices, times: Array) -> tuple[Indices, Indices]:
    """Indices of plans and places (j,), each of several like places once.

    Places of the same candidate and the same repetitions are alike. A place without measurements
    contributes nothing and is left out.
    """
    same_candidate = places[:, :, None] == places[:, None, :]
    same_times = times[:, :, None] == times[:, None, :]
    repeated = np.tril(same_candidate & same_times, -1).any(axis=2)
    of, place = np.nonzero(~repeated & (times > 0))
    return of, place
