"""The search for the experiments, the loads and the best plan of a day."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from time import monotonic

import numpy as np

from criteria import Relaxable
from edtk.design.bound import Bound, BoundKind
from edtk.design.candidate_source import CandidateSource
from edtk.design.design_space import DesignSpace
from edtk.design.exact.day import DayBudget, DayCosts, DayPlan, affords, most_visits
from edtk.design.exact.exact_plan import ExactPlan, FoundPlan, NoPlanError
from edtk.design.exact.visit_search import VisitSearch
from edtk.design.plan import Plan
from edtk.design.problem import RankDeficientError
from edtk.design.relaxation.relax_poses import RelaxOptions, relaxed_in_time
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.design.relaxation.restricted_master import RelaxationError
from edtk.system.errors import UserError
from edtk.system.time_limit import out_of_time, time_left, time_limit
from edtk.system.typing import Array
from edtk.system.workers import THIS_PROCESS, Workers, one_thread

AS_GOOD = 1e-4  # relative difference of costs of plans below which the cheaper day is better
MORE_TIME = 1.25  # times the share that was too short for a set of loads: less finds no more
# Of a search whose first plan is there already: that plan stands, with its bound.
FAILURES = (RankDeficientError, RelaxationError, UserError)
Loads = tuple[int, ...]
OfSize = Callable[[RelaxedPlan, int, int | None], FoundPlan]


@dataclass(frozen=True, eq=False)
class LoadTrial:
    """The best plan of one set of loads.

    Attributes:
        loads: Indices of the loads.
        relaxed: The relaxation over its poses.
        total: Experiments, or what they cost, of which the relaxation has one.
        found: The plan; None where it could not be better than another one.
        interrupted: Whether Ctrl-C has ended its search.
    """

    loads: Loads
    relaxed: RelaxedPlan
    total: float
    found: FoundPlan | None
    interrupted: bool = False

    @property
    def bound(self) -> Bound:
        """No plan of these loads costs less."""
        return self.relaxed.best_bound.scaled(self.total)

    @property
    def promise(self) -> float:
        """The cost of the best weights, which the best plan comes near."""
        return self.relaxed.cost * self.total**-self.relaxed.criterion.degree

    @property
    def plan(self) -> Plan:
        """The plan that was found."""
        assert self.found is not None
        return self.relaxed.space.plan(self.found.x, self.found.repeats)

    @classmethod
    def of(
        cls, loads: Loads, relaxed: RelaxedPlan, total: float, found: FoundPlan | None
    ) -> "LoadTrial":
        """A trial whose bound holds for the plan that was found."""
        if found is not None:
            relaxed = relaxed.holding_for(found.x)
        return cls(loads, relaxed, total, found)

    def searched(self, planned: Callable[[], FoundPlan | None]) -> "LoadTrial":
        """The trial with the plan that is found, in a moment where it is interrupted already.

        Args:
            planned: Searches the plan, within the time that is left.

        Raises:
            KeyboardInterrupt: It is interrupted once more.
        """
        interrupted = self.interrupted
        try:
            with time_limit(0.0 if interrupted else np.inf):
                found = planned()
        except KeyboardInterrupt:
            if interrupted:
                raise
            interrupted = True  # before a first plan, which takes a moment where time is over
            with time_limit(0.0):
                found = planned()
        if found is not None:
            interrupted = interrupted or found.ended == "interrupted"
            found = replace(found, ended="interrupted") if interrupted else found
        trial = LoadTrial.of(self.loads, self.relaxed, self.total, found)
        return replace(trial, interrupted=interrupted)

    def on_candidates(self) -> "LoadTrial":
        """The trial with the bound that is proved on candidates and the plan's own poses alone."""
        relaxed = self.relaxed
        # With a cell, time may have ended between the searches without it and with it.
        if relaxed.searched_bound is None and relaxed.certified.searched_bound is None:
            return self
        return self.of(self.loads, relaxed.on_candidates, self.total, self.found)

    def or_better(self, earlier: "LoadTrial | None") -> "LoadTrial":
        """The trial with what an earlier one knew better: its plan, and its bound of this kind."""
        if earlier is None:
            return self
        bounds = self.bound, earlier.bound
        tells_more = bounds[0].kind is bounds[1].kind and bounds[0].cost < bounds[1].cost
        relaxed = earlier.relaxed if tells_more else self.relaxed
        found = min(self, earlier, key=_cost).found
        return LoadTrial.of(self.loads, relaxed, self.total, found)


@dataclass(frozen=True, eq=False, kw_only=True)
class DaySearch:
    """One search for the plan of a day.

    Without a budget all loads are there to choose from, and the size alone decides. With one, a
    plan of several loads has to pay for load changes: the best plans of each set of loads are
    searched within what the budget leaves, and the best of them is taken. A set whose bound is no
    better than a plan that was found already is not searched.

    Attributes:
        source: Where candidates come from; its design space knows nothing besides.
        candidates: Number of candidates.
        wrenches: The loads (s, 6) to choose from, none counted as one [N, N m]; None where every
            experiment chooses its own.
        criterion: What is minimised.
        known: Information (p, p) of all that is known besides; None for nothing.
        kept: Experiments that were made already, whose information is a part of that.
        new: Number of new experiments; None where the budget decides.
        costs: What visits and load changes cost; None where nothing does.
        distinct: Different new experiments at most; None for any number.
        seed: Seed.
        relax: Accuracy and progress of the relaxations.
        searches: Over all poses for a bound, at most.
        of_size: Searches the best plan of so many experiments from a relaxation; None for that of
            `VisitSearch`, which many parameters need.
        workers: The processes that improve plans side by side, where `of_size` has none of its own.
        progress: Called with a label and the best cost.
    """

    source: CandidateSource
    candidates: int
    wrenches: Array | None
    criterion: Relaxable
    known: Array | None
    kept: Plan | None
    new: int | None
    costs: DayCosts | None
    distinct: int | None
    seed: int
    relax: RelaxOptions = field(default_factory=RelaxOptions)
    searches: float = np.inf
    of_size: OfSize | None = None
    workers: Workers = THIS_PROCESS
    progress: Callable[[str, float], object]

    @property
    def space(self) -> DesignSpace:
        """Where experiments may lie, under any of the loads."""
        return self.source.space

    @property
    def budget(self) -> DayBudget:
        """What the costs of the day leave for experiments."""
        return DayBudget(self.wrenches, self.new, self.costs)

    def run(self) -> DayPlan:
        """Search each set of loads, and take the best plan.

        Where there are several sets, each has a first plan and a first bound before any of them is
        searched in earnest: the bound of a day rests on all of them. Those that promise most come
        first, since what they find shows of others that they cannot be better.

        Raises:
            RankDeficientError: No experiments tell what the criterion needs.
            NoPlanError: So few do not.
        """
        # The rounding of a product may depend on the number of threads, and so would the plan.
        with one_thread():
            return self._run()

    def _run(self) -> DayPlan:
        """The same in one thread."""
        since = monotonic()
        sets = dict(self.budget.sets())
        trials: dict[Loads, LoadTrial] = {}
        refused: RankDeficientError | None = None
        ended = ""
        if len(sets) > 1:
            for loads, funds in sets.items():
                try:
                    trials[loads] = self._first(loads, funds, trials)
                except RankDeficientError as error:
                    # Without a load, springs are open; with it, they may be told.
                    refused = error
            sets = {loads: sets[loads] for loads in sorted(trials, key=lambda i: trials[i].promise)}
            ended = "interrupted" if _interrupted(trials) else ""
        ended = ended or self._search_all(sets, trials)
        found = [one for one in trials.values() if one.found and np.isfinite(one.found.cost)]
        if not found and not trials:
            assert refused is not None
            raise refused
        if not found:
            raise NoPlanError(f"so few experiments cannot tell what {self.criterion.label} needs")
        result = self._result(self._cheapest(found), list(trials.values()))
        return replace(result, seconds=monotonic() - since, ended=ended or result.ended)

    def _first(self, loads: Loads, funds: float, trials: dict[Loads, LoadTrial]) -> LoadTrial:
        """The first plan of a set of loads, beside those of others.

        The bound of a day rests on all sets: once one has its plan, Ctrl-C waits for the others.

        Raises:
            KeyboardInterrupt: There is no plan yet, or it is interrupted once more.
        """
        with time_limit(0.0):
            try:
                return self._trial(loads, funds)
            except KeyboardInterrupt:
                if not trials or _interrupted(trials):
                    raise
                return replace(self._trial(loads, funds), interrupted=True)

    def _search_all(self, sets: dict[Loads, float], trials: dict[Loads, LoadTrial]) -> str:
        """Search each set of loads, whose first plans are there already where it has others.

        Each has its share of the time. What is left of it goes to the sets whose share was too
        short, as long as they get more than before.

        Args:
            sets: The sets, and what the budget leaves for experiments.
            trials: The best of each, which changes.

        Returns:
            Why the search ended, "budget", "interrupted" or "failed"; empty where it came to its
            end.
        """
        shares = dict.fromkeys(sets, 0.0)
        ended = failed = ""
        try:
            while shares:
                last, shares = shares, {}
                for i, (loads, had) in enumerate(last.items()):
                    left = time_left()
                    share = max(left / (len(last) - i), MORE_TIME * had)
                    if trials and (left <= 0 or left < share):
                        ended = "budget"
                        continue
                    try:
                        if self._is_cut(loads, sets[loads], share, trials):
                            shares[loads] = share
                    except FAILURES as error:
                        if loads not in trials:
                            raise
                        failed = "failed"
                        self.progress(f"failed: {error}", _cost(trials[loads]))
        except KeyboardInterrupt:
            if not trials:
                raise
            return "interrupted"
        return failed or ("budget" if out_of_time() else ended)

    def _is_cut(
        self, loads: Loads, funds: float, share: float, trials: dict[Loads, LoadTrial]
    ) -> bool:
        """Search a set of loads, and tell whether more time than its share might find more.

        Raises:
            KeyboardInterrupt: The search was interrupted; what it had found is among the trials.
        """
        least = min((_cost(one) for key, one in trials.items() if key != loads), default=np.inf)
        with time_limit(share):
            trial = self._trial(loads, funds, least)
            is_over = out_of_time()
        ended = "" if trial.found is None else trial.found.ended
        # A first plan counts no more where no plan of these loads can be the best one.
        is_open = trial.bound.cost < least
        trials[loads] = trial.or_better(trials.get(loads)) if is_open else trial
        if trial.interrupted:
            raise KeyboardInterrupt
        return is_open and (is_over or ended == "budget")

    def _cheapest(self, found: list[LoadTrial]) -> LoadTrial:
        """Of the plans that are as good as the best one, that which costs least."""
        least = min(map(_cost, found))
        best = [one for one in found if _cost(one) <= least * (1 + AS_GOOD)]
        if self.costs is None:
            return best[0]
        spent = [self.costs.spent(one.plan) for one in best]
        return best[int(np.argmin(spent))]

    def _trial(self, loads: Loads, funds: float, least: float = np.inf) -> LoadTrial:
        """The best plan of a set of loads, unless its bound is no better than a least cost."""
        space = self.space
        if self.wrenches is not None:
            space = space.with_loads(self.wrenches, loads)
        prices = self.budget.prices(loads)
        m = self.new
        one_price = bool((prices == prices[0]).all()) or not np.isfinite(funds)
        if m is None and one_price:
            m = most_visits(funds, prices[0])
        total = float(funds if m is None else m)
        if m is None:
            space = replace(space, prices=prices)
        relaxed, interrupted = self._relaxed(self.beside_known(space, total), total, least)
        trial = LoadTrial(loads, relaxed, total, None, interrupted)
        if trial.bound.cost >= least:
            return trial
        search = VisitSearch(
            self.beside_known(replace(space, prices=None), 1.0 if m is None else total),
            relaxed,
            self.criterion,
            self.seed,
            self.progress,
            workers=self.workers,
            kept=self.kept,
        )
        of_size = self.of_size or (lambda _, m, distinct: search.of_size(m, distinct))

        def planned() -> FoundPlan | None:
            if m is not None and (one_price or affords(funds, prices.max() * m)):
                return of_size(relaxed, m, self.distinct)
            most = most_visits(funds, prices.min()) if m is None else m
            return search.within(prices, funds, most, m is not None, self.distinct)

        return trial.searched(planned)

    def beside_known(self, space: DesignSpace, total: float) -> DesignSpace:
        """The space with its share of what is known besides."""
        if self.known is None:
            return space
        return replace(space, prior=self.known / total, sharing=max(int(total), 1))

    def _relaxed(self, space: DesignSpace, total: float, least: float) -> tuple[RelaxedPlan, bool]:
        """The relaxation over all feasible poses, and whether Ctrl-C has ended it.

        It needs no sharper bound once none of its plans can cost less than `least`.
        """
        rounds = 0

        def stop(plan: RelaxedPlan) -> bool:
            return rounds >= self.searches or plan.best_bound.scaled(total).cost >= least

        def progress(stage: str, gap: float) -> None:
            nonlocal rounds
            # With a cell there are two relaxations, each of which begins with its candidates.
            rounds = 0 if stage == "candidates" else rounds + (stage == "continuum")
            self.progress(f"bound: {stage}", gap)

        return relaxed_in_time(
            replace(self.source, space=space),
            self.candidates,
            self.criterion,
            replace(self.relax, progress=progress, stop=stop),
        )

    def _result(self, best: LoadTrial, trials: list[LoadTrial]) -> DayPlan:
        """The plan, with a bound on the plans of all sets of loads."""
        assert best.found is not None
        # What holds for all sets of loads is as far-reaching as the narrowest of their bounds.
        searched = all(one.bound.kind is BoundKind.SEARCHED for one in trials)
        if not searched:
            trials = [one.on_candidates() for one in trials]
            best = next(one for one in trials if one.loads == best.loads)
        assert best.found is not None
        kind = BoundKind.SEARCHED if searched else BoundKind.PROVED_ON_CANDIDATES
        # Beyond the cell: whether poses are free or not.
        beyond_cell = [one.relaxed.certified.best_bound.scaled(one.total) for one in trials]
        least, beyond = (
            replace(min(bounds, key=lambda one: one.cost), kind=kind)
            for bounds in ([one.bound for one in trials], beyond_cell)
        )
        plain = ExactPlan.of(best.relaxed, best.found, self.kept)
        return DayPlan(
            **{name: getattr(plain, name) for name in plain.__dataclass_fields__},
            bound_of_all=least,
            bound_without_cell=None if best.relaxed.without_cell is None else beyond,
            wrenches=self.wrenches,
            costs=self.costs,
            tried={one.loads: _cost(one) for one in trials} if len(trials) > 1 else {},
            asked=self.new,
            proofs={one.loads: one.relaxed for one in trials},
        )


def _cost(trial: LoadTrial) -> float:
    """The cost of the plan that was found; infinite without one."""
    return np.inf if trial.found is None else trial.found.cost


def _interrupted(trials: dict[Loads, LoadTrial]) -> bool:
    """Whether Ctrl-C has ended one of the searches."""
    return any(one.interrupted for one in trials.values())
