"""Exact plans in a region: exchange on a grid, then all points move to an optimum nearby."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import monotonic
from typing import TYPE_CHECKING

import numpy as np

from criteria import Criterion
from edtk.design.bound import VISIBLE, Bound, BoundedDesign
from edtk.design.exact.apportion import apportion
from edtk.design.exact.counts.counts_search import SAME_COST
from edtk.design.exact.exchange import exchange
from edtk.design.exact.refine import SHARPNESS, refine
from edtk.design.information import Known, Rows
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.design.relaxation.relax_region import relax_region
from edtk.design.relaxation.relaxed_region import RelaxedRegion
from edtk.design.relaxation.search_region import (
    LOSS_FOR_FEWER_POINTS,
    RegionGrid,
    grouped,
    onto_walls,
)
from edtk.system.errors import ArgumentError, UserError
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd

    from edtk.design.theta_box import WorstTheta

REGION_PLAN_STARTS = 32
GRID = 600  # points among which places are exchanged, besides those of the relaxation
REFINED = 3  # plans of either kind that are refined one by one to the end
AS_POINTS = 24  # experiments up to which all plans are refined at once, each experiment as a point
JITTER = 3e-3  # parts of a range by which repeats of a point are set apart
REGION_PLAN_ROUNDS = 4  # of exchange and refinement in turn; the second one seldom finds anything
CLOSE = (0.03, 0.003, 1e-4)  # parts of a range up to which points are tried as one
FINE = (1000.0, 4000.0)  # last soft maxima of a criterion with kinks


@dataclass(frozen=True, eq=False)
class RegionPlan(BoundedDesign):
    """The best plan of some experiments in a region that a search has found.

    Attributes:
        relaxed: The relaxation that the search started from, with its bound.
        points: Points (k, d), in the order of their variables.
        counts: Number of new experiments at each (k,).
        kept: Number of experiments that were made already.
        cost: The criterion's cost of all experiments together.
        starts: Number of starts of the search.
        found: How many of them led to a plan as good as this one.
        seconds: Duration of the search [s], the relaxation included.
        worst: Where in ranges of theta it is worst; None of a region without any.
    """

    relaxed: RelaxedRegion
    points: Array
    counts: Indices
    kept: int
    cost: float
    starts: int
    found: int
    seconds: float
    worst: "WorstTheta | None" = None

    def headline(self) -> str:
        """Criterion, value, size and efficiency."""
        accuracy = self.accuracy
        digits = f", numbers to {accuracy:.0e}" if accuracy > VISIBLE else ""
        return (
            f"{self.criterion.label} = {self.value:.6g} with {self.size} experiments at "
            f"{len(self.points)} points, efficiency {100 * self.efficiency:.2f} % "
            f"({self.lower_bound.kind.value} bound){digits}"
            f"{'' if self.worst is None else f', {self.worst}'}"
        )

    @property
    def accuracy(self) -> float:
        """Relative error that rounding may have made in cost and bound."""
        weights = self.counts / self.counts.sum()
        relaxed = self.relaxed
        return sum(relaxed.judged.errors(self.points, weights, relaxed.multipliers))

    @property
    def region(self) -> Region:
        """The region; what was kept is part of its prior."""
        return self.relaxed.region

    @property
    def criterion(self) -> Criterion:
        """What was minimised."""
        return self.relaxed.criterion

    @property
    def size(self) -> int:
        """Number of experiments, kept ones included."""
        return int(self.counts.sum()) + self.kept

    @property
    def experiments(self) -> Array:
        """Points (m, d) of all new experiments, each as often as it is measured."""
        return np.repeat(self.points, self.counts, axis=0)

    @property
    def lower_bound(self) -> Bound:
        """The bound on the cost of every plan of so many experiments."""
        # What was kept is part of the relaxation's prior, in equal parts for each new experiment.
        return self.relaxed.told_bound.scaled(int(self.counts.sum()))

    @property
    def bounds(self) -> dict[str, Bound]:
        """Those of weights, on so many new experiments."""
        m = int(self.counts.sum())
        return {name: bound.scaled(m) for name, bound in self.relaxed.bounds.items()}

    @property
    def told_bound(self) -> Bound:
        """That of every plan of so many experiments."""
        return self.lower_bound

    @property
    def information(self) -> Array:
        """Information matrix (p, p) of all experiments, kept ones and the prior included."""
        return self.region.problem(self.points).information(self.counts)

    def to_frame(self) -> "pd.DataFrame":
        """Make a table with a point a row and its number of experiments in the last column."""
        import pandas as pd

        frame = pd.DataFrame(self.points, columns=list(self.region.variables))
        return frame.assign(count=self.counts)


def plan_region(
    region: Region,
    size: int,
    criterion: Criterion,
    seed: int = 0,
    starts: int | None = None,
    keep: Problem | None = None,
    progress: Callable[[str, float], object] = lambda stage, number: None,
    relaxed_by: Callable[..., RelaxedRegion] = relax_region,
) -> RegionPlan:
    """Find the best plan of some experiments in a region, and bound how much better any can be.

    Starts are the apportioned weights of the relaxation, draws by these weights, and random points
    of a grid. Exchanges bring each to a local optimum among the grid and the points of the
    relaxation. The plans then leave the grid: all points of a plan move together (`refine`), once
    with each experiment a point of its own and once with repeats kept. Points that end close are
    one.

    Args:
        region: The region.
        size: Number of experiments; kept ones count.
        criterion: A criterion that can be relaxed.
        seed: Seed of the starts; the same seed gives the same plan.
        starts: Number of starts; defaults to 32.
        keep: Experiments that were made already, once each.
        progress: Called with the stage, and its gap or its best cost.
        relaxed_by: What finds the relaxation: `relax_region`, or what proves its bound besides.

    Raises:
        ArgumentError: Size or starts are not positive, or kept experiments do not fit.
        UserError: No plan of so few experiments identifies all parameters.
    """
    number = REGION_PLAN_STARTS if starts is None else starts
    m = size - (0 if keep is None else keep.n)
    _require(region, size, number, keep)
    since = monotonic()
    beside = region if keep is None else region.beside(_known(region, m, keep))
    relaxed = relaxed_by(beside, criterion.for_size(m), progress=progress)
    judged = relaxed.judged
    search = _Search(judged.region, judged.criterion, np.random.default_rng(seed))
    x = np.concatenate([relaxed.points, RegionGrid.of(region, GRID).x])
    problem = judged.region.problem(x)
    places = search.starts(relaxed.weights, len(x), m, number)
    # The points leave the grid afterwards, so that a look at all of it would be wasted on most.
    places, costs = exchange(problem, judged.criterion, places, thorough=False)
    if not np.isfinite(costs).any():
        experiments = f"{size} experiment{'s' if size > 1 else ''}"
        raise UserError(
            f"no plan of {experiments} identifies what is asked for; expected more of them"
        )
    progress("exchange", float(np.min(costs)))
    best = search.best_refined(x, places, costs)
    progress("refine", best.cost)
    order = np.lexsort(np.round(best.x, 9).T[::-1])
    return RegionPlan(
        relaxed=relaxed,
        points=best.x[order],
        counts=best.repeats[order].astype(int),
        kept=size - m,
        cost=best.cost,
        starts=number,
        found=int((costs <= costs.min() * (1 + SAME_COST)).sum()),
        seconds=monotonic() - since,
    )


def _require(region: Region, size: int, starts: int, keep: Problem | None) -> None:
    """Check the numbers of a question.

    Raises:
        ArgumentError: See `plan_region`.
    """
    if starts < 1:
        raise ArgumentError("expected one or more", argument="starts", given=starts)
    if keep is not None and keep.p != region.p:
        message = f"kept experiments have {keep.p} parameters, expected {region.p}"
        raise ArgumentError(message, argument="keep")
    kept = 0 if keep is None else keep.n
    if size - kept < 1:
        beside = f" beside {kept} kept experiments" if kept else ""
        raise ArgumentError(f"expected one or more{beside}", argument="size", given=size)


def _known(region: Region, m: int, keep: Problem) -> Known:
    """What each of m new experiments has: its prior, and its part of what is kept.

    The region's prior is per experiment of the plan, of which kept ones are a part.
    """
    kept = keep.kept
    found = Known.of(np.zeros((region.p, region.p)))
    if isinstance(kept, Rows):
        found = replace(found, rows=kept.each)
    else:
        found = found.plus(kept.weighted(np.ones(keep.n)))
    if region.prior is not None:
        found = found.plus((m + keep.n) * region.prior)
    return found.shared(m)


@dataclass(frozen=True, eq=False)
class _Plan:
    """Points x (k, d) with whole repeats (k,), and the cost."""

    x: Array
    repeats: Array
    cost: float


@dataclass(frozen=True, eq=False)
class _Search:
    """The parts of a search that stay the same."""

    region: Region
    criterion: Criterion
    rng: np.random.Generator

    def starts(self, weights: Array, n: int, size: int, number: int) -> Indices:
        """Places (number, size) among n candidates, the first ones of which have weights."""
        whole = np.repeat(np.arange(len(weights)), apportion(weights, size))
        drawn = [whole]
        for i in range(number - 1):
            by_weight = self.rng.choice(len(weights), size, p=weights / weights.sum())
            anywhere = self.rng.integers(n, size=size)
            # From the relaxation's points alone to no weight on them, in turn.
            keeps = self.rng.random(size) < 1 - (i % 4) / 3
            drawn.append(np.where(keeps, by_weight, anywhere))
        return np.array(drawn)

    def best_refined(self, x: Array, places: Indices, costs: Array) -> _Plan:
        """The best plan after refinement, and after exchanges for points of other plans."""
        plans = self._different(x, places, costs)
        apart = self._set_apart(plans) if places.shape[1] <= AS_POINTS else []
        apart.sort(key=lambda plan: plan.cost)
        plans = [self._tidied(plan) for plan in (*apart[:REFINED], *plans[:REFINED])]
        best = min(plans, key=lambda plan: plan.cost)
        for _ in range(REGION_PLAN_ROUNDS):
            known = np.concatenate([best.x, *(plan.x for plan in plans), x])
            start = np.repeat(np.arange(len(best.x)), best.repeats.astype(int))
            again, cost = exchange(self.region.problem(known), self.criterion, start)
            if not cost < best.cost * (1 - SAME_COST):
                break
            best = self._tidied(self._grouped(known, again, float(cost)))
        return best if self.criterion.smooth else self._tidied(best, FINE)

    def _different(self, x: Array, places: Indices, costs: Array) -> list[_Plan]:
        """The plans of finite cost whose costs differ, the best first."""
        chosen: list[int] = []
        for i in np.argsort(costs, kind="stable"):
            is_new = not chosen or costs[i] > costs[chosen[-1]] * (1 + SAME_COST)
            if is_new and np.isfinite(costs[i]):
                chosen.append(int(i))
        return [self._grouped(x, places[i], float(costs[i])) for i in chosen]

    def _set_apart(self, plans: list[_Plan]) -> list[_Plan]:
        """The plans after each of their experiments has moved as a point of its own, all at once.

        Repeats of a point begin a little apart: where they are, nothing would part them.
        """
        low, high = self.region.limits
        each = np.array([np.repeat(plan.x, plan.repeats.astype(int), axis=0) for plan in plans])
        off = each + JITTER * (high - low) * self.rng.uniform(-1, 1, each.shape)
        once = np.ones(each.shape[:2])
        x, costs = refine(self.region, self.criterion, np.clip(off, low, high), once)
        return [_Plan(x[i], once[i], float(costs[i])) for i in range(len(plans))]

    def _grouped(self, x: Array, places: Indices, cost: float) -> _Plan:
        """A plan of places (size,), each point once."""
        used, repeats = np.unique(places, return_counts=True)
        return _Plan(x[used], repeats.astype(float), cost)

    def _tidied(self, plan: _Plan, sharpness: tuple[float, ...] = SHARPNESS) -> _Plan:
        """The plan after a last refinement, with few points; never worse."""
        best = min(plan, self._moved(plan, sharpness), key=lambda each: each.cost)
        for close in CLOSE:
            fewer = self._merged(best, close)
            if len(fewer.x) < len(best.x):
                fewer = self._moved(fewer, sharpness)
                best = fewer if fewer.cost <= best.cost * (1 + LOSS_FOR_FEWER_POINTS) else best
        return best

    def _moved(self, plan: _Plan, sharpness: tuple[float, ...] = SHARPNESS) -> _Plan:
        """The plan after one refinement, with its points on the walls that they almost touch."""
        times = plan.repeats[None]
        x = refine(self.region, self.criterion, plan.x[None], times, sharpness=sharpness)[0]
        on_walls = onto_walls(self.region, x[0])
        plans = [self._plan(points, plan.repeats) for points in (x[0], on_walls)]
        best = min(plans, key=lambda each: each.cost)
        # Walls are where people read a plan: they win where that costs nothing.
        return plans[1] if plans[1].cost <= best.cost * (1 + LOSS_FOR_FEWER_POINTS) else best

    def _plan(self, x: Array, repeats: Array) -> _Plan:
        """A plan with its cost, inf where a point is not feasible."""
        if not self.region.at(x).feasible.all():
            return _Plan(x, repeats, np.inf)
        problem: Problem = self.region.problem(x)
        return _Plan(x, repeats, float(self.criterion.cost(problem.information(repeats))))

    def _merged(self, plan: _Plan, close: float) -> _Plan:
        """Points nearer than `close` as one, at the place of the one with most repeats."""
        kept, owner = grouped(self.region, plan.x, plan.repeats, close)
        repeats = np.bincount(owner, weights=plan.repeats).astype(float)
        return _Plan(plan.x[kept], repeats, np.inf)
