"""The search for the visits, the loads and the best plan of a day."""

from dataclasses import dataclass, replace
from time import monotonic

import numpy as np

from criteria import Relaxable
from edtk.calibration.geometry_design.day_costs import (
    DayBudget,
    DayCosts,
    PosesByLoad,
    affords,
    most_visits,
)
from edtk.calibration.geometry_design.geometry_plan import GeometryPlan
from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.calibration.geometry_design.geometry_space import GeometrySpace
from edtk.calibration.geometry_design.visit_search import (
    FoundVisits,
    VisitSearch,
    new_visits,
    too_few_visits,
)
from edtk.design.bound import Bound, BoundKind
from edtk.design.exact.exact_plan import ExactPlan, TooFewExperimentsError, require_enough
from edtk.design.plan import Plan
from edtk.design.problem import RankDeficientError
from edtk.design.relaxation.relax import require_relaxable
from edtk.design.relaxation.relax_poses import RelaxOptions, relaxed_in_time
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.study.plan_study import RunOptions, source_of
from edtk.system.errors import ArgumentError
from edtk.system.time_limit import out_of_time, time_left, time_limit

TOLERANCE = 2e-2  # relative gap of a bound: that of 35 parameters would take minutes to 1e-3
SEARCHES = 12  # over all poses for the bound, at most: what is left after them is a per cent or two
MOST_LOADS = 5  # none counted: of more, too many sets would have to be searched one by one
AS_GOOD = 1e-4  # relative difference of costs of plans below which the cheaper day is better


@dataclass(frozen=True, eq=False)
class LoadTrial:
    """The best plan of one set of loads.

    Attributes:
        loads: Indices of the loads.
        relaxed: The relaxation over its poses.
        total: Visits, or what they cost, of which the relaxation has one.
        found: The plan; None where it could not be better than another one.
    """

    loads: tuple[int, ...]
    relaxed: RelaxedPlan
    total: float
    found: FoundVisits | None

    @property
    def bound(self) -> Bound:
        """No plan of these loads costs less."""
        return self.relaxed.best_bound.scaled(self.total)

    @classmethod
    def of(
        cls,
        loads: tuple[int, ...],
        relaxed: RelaxedPlan,
        total: float,
        found: FoundVisits | None,
    ) -> "LoadTrial":
        """A trial whose bound holds for the plan that was found."""
        if found is not None and relaxed.searched_bound is None:
            relaxed = relaxed.holding_for(found.x)
        return cls(loads, relaxed, total, found)

    def or_better(self, earlier: "LoadTrial | None") -> "LoadTrial":
        """The trial with the plan of an earlier one, where that is better or the only one."""
        if earlier is None or earlier.found is None:
            return self
        if self.found is not None and self.found.cost <= earlier.found.cost:
            return self
        return LoadTrial.of(self.loads, self.relaxed, self.total, earlier.found)

    def price(self, question: GeometryQuestion, costs: DayCosts) -> float:
        """What the day of the plan costs."""
        assert self.found is not None
        visits = self.relaxed.space.plan(self.found.x, self.found.repeats)
        poses = PosesByLoad.of(visits, question.wrenches, question.study.robot)
        return costs.total(poses.wrenches, poses.visits.sum(axis=0))


@dataclass(frozen=True, eq=False)
class DaySearch:
    """One search for the plan of a day, see `plan_geometry`.

    Attributes:
        question: What a study of geometry asks for.
        criterion: What is minimised.
        kept: Visits that were made already.
        new: Number of new visits; None where the budget decides.
        costs: What visits and load changes cost; None where nothing does.
        options: Seed and progress.
        distinct: Different new visits at most; None for any number.
    """

    question: GeometryQuestion
    criterion: Relaxable
    kept: Plan | None
    new: int | None
    costs: DayCosts | None
    options: RunOptions
    distinct: int | None = None

    @classmethod
    def of(
        cls,
        question: GeometryQuestion,
        size: int | None,
        criterion: str | None,
        kept: Plan | None,
        cost_budget: float | None,
        options: RunOptions,
    ) -> "DaySearch":
        """Check the arguments.

        Raises:
            ArgumentError: One of them is impossible.
        """
        costs = DayCosts.of(question.study, cost_budget)
        budget = None if costs is None else costs.budget
        if size is None and budget is None:
            message = "expected the number of visits, unless a budget of costs decides"
            raise ArgumentError(message, argument="size")
        if budget is not None and len(question.wrenches) > MOST_LOADS + 1:
            raise question.study.error(
                "load.list_F_N",
                f"plans within a budget choose among {MOST_LOADS} loads at most; list fewer",
            )
        return cls(
            question,
            require_relaxable(question.criterion(criterion)),
            kept,
            new_visits(size, kept),
            costs,
            options,
        )

    def limited(self, distinct: int | None) -> "DaySearch":
        """The same search for plans of so many different visits at most.

        Raises:
            ArgumentError: They are more than the visits, or too few.
        """
        if distinct is None:
            return self
        if self.new is None:
            return replace(self, distinct=distinct)
        if distinct > self.new:
            message = f"expected at most {self.new}, the number of new visits"
            raise ArgumentError(message, argument="distinct", given=distinct)
        if self.kept is None and self.criterion.needs_all:
            try:
                require_enough(self.question.space, self.new, distinct, self.criterion)
            except TooFewExperimentsError as error:
                argument = "size" if self.new < error.least else "distinct"
                raise ArgumentError(str(error), argument=argument) from error
        return replace(self, distinct=distinct)

    def run(self) -> GeometryPlan:
        """Search each set of loads, and take the best plan.

        Where there are several sets, each has a first plan and a first bound before any of them is
        searched in earnest: the bound of a day rests on all of them.
        """
        since = monotonic()
        self._require_enough()
        sets = dict(self.budget.sets())
        trials: dict[tuple[int, ...], LoadTrial] = {}
        refused: RankDeficientError | None = None
        if len(sets) > 1:
            for loads, funds in sets.items():
                try:
                    with time_limit(0.0):
                        trials[loads] = self._trial(loads, funds)
                except RankDeficientError as error:
                    # Without a load, springs are open; with it, they may be told.
                    refused = error
            sets = {loads: sets[loads] for loads in trials}
        ended = self._search_all(sets, trials)
        found = [one for one in trials.values() if one.found and np.isfinite(one.found.cost)]
        if not found and not trials:
            assert refused is not None
            raise refused
        if not found:
            raise self._too_few()
        result = self._result(self._cheapest(found), list(trials.values()))
        return replace(result, seconds=monotonic() - since, ended=ended or result.ended)

    def _search_all(
        self, sets: dict[tuple[int, ...], float], trials: dict[tuple[int, ...], LoadTrial]
    ) -> str:
        """Search each set of loads, whose first plans are there already where it has others.

        Args:
            sets: The sets, and what the budget leaves for visits.
            trials: The best of each, which changes.

        Returns:
            Why the search ended, "budget" or "interrupted"; empty where it came to its end.
        """
        for i, (loads, funds) in enumerate(sets.items()):
            if trials and out_of_time():
                return "budget"
            others = [one.found.cost for key, one in trials.items() if one.found and key != loads]
            least = min(others, default=np.inf)
            try:
                with time_limit(time_left() / (len(sets) - i)):
                    trial = self._trial(loads, funds, least)
            except KeyboardInterrupt:
                if not trials:
                    raise
                return "interrupted"
            # A first plan counts no more where no plan of these loads can be the best one.
            is_open = trial.bound.cost < least
            trials[loads] = trial.or_better(trials.get(loads)) if is_open else trial
            if trial.found is not None and trial.found.ended == "interrupted":
                return "interrupted"
        return "budget" if out_of_time() else ""

    def _require_enough(self) -> None:
        """Check that visits are enough to tell all parameters apart, before any search.

        Raises:
            ArgumentError: They are not, or the budget pays for no plan, or for too many visits.
        """
        budget = self.budget
        most = max(
            self.new or most_visits(funds, float(budget.prices(loads).min()))
            for loads, funds in budget.sets()
        )
        model = self.question.model
        rows = most * model.row_count * len(model.markers)
        # Twice as many rows as parameters are enough, wherever markers are not in one place.
        if self.kept is not None or not self.criterion.needs_all or rows >= 2 * model.p:
            return
        try:
            require_enough(self.question.space, most, most, self.criterion)
        except TooFewExperimentsError as error:
            raise self._too_few(error.least) from error

    def _too_few(self, least: int | None = None) -> ArgumentError:
        """The error of visits that leave open what the criterion needs."""
        budget = None if self.costs is None else self.costs.budget
        model = self.question.model
        return too_few_visits(
            model, self.criterion, self.new, self.kept, budget, self.distinct, least
        )

    def _cheapest(self, found: list[LoadTrial]) -> LoadTrial:
        """Of the plans that are as good as the best one, that which costs least."""
        results = [(one, one.found) for one in found if one.found is not None]
        least = min(plan.cost for _, plan in results)
        best = [(one, plan) for one, plan in results if plan.cost <= least * (1 + AS_GOOD)]
        if self.costs is None:
            return best[0][0]
        spent = [one.price(self.question, self.costs) for one, _ in best]
        return best[int(np.argmin(spent))][0]

    def _trial(self, loads: tuple[int, ...], funds: float, least: float = np.inf) -> LoadTrial:
        """The best plan of a set of loads, unless its bound is no better than a least cost."""
        space = self.question.space.with_loads(self.question.wrenches, loads)
        prices = self.budget.prices(loads)
        m = self.new
        one_price = bool((prices == prices[0]).all()) or not np.isfinite(funds)
        if m is None and one_price:
            m = most_visits(funds, prices[0])
        total = float(funds if m is None else m)
        if m is None:
            space = replace(space, prices=prices)
        space = self._beside_kept(space, total)
        relaxed, interrupted = self._relaxed(space, total, least)
        if relaxed.best_bound.scaled(total).cost >= least:
            return LoadTrial(loads, relaxed, total, None)
        counted = replace(space, prices=None)
        if m is None and space.prior is not None:
            counted = self._beside_kept(replace(counted, prior=None), 1.0)
        search = VisitSearch(counted, relaxed, self.criterion, self._seed, self._progress)
        with time_limit(0.0 if interrupted else np.inf):
            if m is not None and (one_price or affords(funds, prices.max() * m)):
                found: FoundVisits | None = search.of_size(m, self.distinct)
            else:
                most = most_visits(funds, prices.min()) if m is None else m
                found = search.within(prices, funds, most, m is not None, self.distinct)
        if found is not None and interrupted:
            found = replace(found, ended="interrupted")
        return LoadTrial.of(loads, relaxed, total, found)

    def _beside_kept(self, space: GeometrySpace, total: float) -> GeometrySpace:
        """The space with its share of what the kept visits tell."""
        if self.kept is None:
            return space
        known = replace(self.question.space, prior=None).information(self.kept)
        return replace(space, prior=known / total, sharing=max(int(total), 1))

    def _relaxed(
        self, space: GeometrySpace, total: float, least: float
    ) -> tuple[RelaxedPlan, bool]:
        """The relaxation over all feasible poses, and whether Ctrl-C has ended it.

        It needs no sharper bound once none of its plans can cost less than `least`.
        """
        rounds = 0

        def stop(plan: RelaxedPlan) -> bool:
            return rounds >= SEARCHES or plan.best_bound.scaled(total).cost >= least

        def progress(stage: str, gap: float) -> None:
            nonlocal rounds
            rounds += stage == "continuum"
            self.options.progress(f"bound: {stage}", gap)

        return relaxed_in_time(
            source_of(self.question.study, self.options.seed, space),
            self.question.study.specification.candidates,
            self.criterion,
            RelaxOptions(tolerance=TOLERANCE, progress=progress, stop=stop),
        )

    @property
    def budget(self) -> DayBudget:
        """What the costs of the day leave for visits."""
        return DayBudget(self.question.wrenches, self.new, self.costs)

    @property
    def _seed(self) -> int:
        seed = self.options.seed
        return self.question.study.specification.seed if seed is None else seed

    def _progress(self, label: str, cost: float) -> None:
        self.options.progress(label, cost)

    def _result(self, best: LoadTrial, trials: list[LoadTrial]) -> GeometryPlan:
        """The plan, with a bound on the plans of all sets of loads."""
        found = best.found
        assert found is not None
        question = self.question
        plan = best.relaxed.space.plan(found.x, found.repeats)
        whole = plan if self.kept is None else self.kept + plan
        M = replace(question.space, prior=None).information(whole)
        least = min(trials, key=lambda one: one.bound.cost).bound
        # What holds for all sets of loads is as far-reaching as the narrowest of their bounds.
        searched = all(one.bound.kind is BoundKind.SEARCHED for one in trials)
        kind = BoundKind.SEARCHED if searched else BoundKind.PROVED_ON_CANDIDATES
        least = replace(least, kind=kind)
        rho0 = None
        if question.target is not None:
            rho0 = float(question.criterion("rho0").value(M))
        plain = ExactPlan(
            best.relaxed,
            plan,
            self.kept,
            float(self.criterion.cost(M)),
            found.starts,
            found.found,
            found.optima,
            0.0,
            found.ended,
            warnings=question.study.warnings,
        )
        return GeometryPlan(
            **{name: getattr(plain, name) for name in plain.__dataclass_fields__},
            question=question,
            bound_of_all=least,
            costs=self.costs,
            tried={one.loads: one.found.cost if one.found else np.inf for one in trials}
            if len(trials) > 1
            else {},
            rho0=rho0,
            asked=self.new,
            proofs={one.loads: one.relaxed for one in trials},
        )
