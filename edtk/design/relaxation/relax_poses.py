"""The relaxation over poses: candidates in memory, beyond it, and all feasible poses."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from time import perf_counter

import numpy as np

from criteria import Criterion, Relaxable
from criteria.linalg.estimable import range_whitener
from edtk.design.bound import Bound, BoundKind
from edtk.design.candidate_source import Candidates, CandidateSource, require_some
from edtk.design.information import distinct
from edtk.design.problem import RankDeficientError
from edtk.design.relaxation.proof import normalised
from edtk.design.relaxation.relax import RelaxationInterrupted, relax, require_relaxable
from edtk.design.relaxation.relaxation import Relaxation
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.design.relaxation.restricted_master import SolverOptions
from edtk.design.relaxation.search_continuum import (
    LargestSensitivities,
    PassCutOffError,
    fresh_poses,
    most_sensitive,
    search_continuum,
    sweep_candidates,
)
from edtk.design.relaxation.settle import settle
from edtk.system.time_limit import no_progress, out_of_time, time_left, time_limit
from edtk.system.typing import Array
from edtk.system.workers import THIS_PROCESS, Workers

BASE_MB = 350.0  # the interpreter with all libraries that a relaxation loads
DEFAULT_MB = 1000.0
# Candidates that a pass over those beyond memory brings back per multiplier, and the least number
# that is worth holding.
KEPT = 20_000
# Doubles per candidate besides information and poses: sensitivities, their order, weights.
DOUBLES_PER_CANDIDATE = 8
# How boldly poses are merged, the boldest first: relative difference of information below which two
# poses are alike, and part of the largest weight below which a pose is dropped. Poses of an optimum
# that symmetry maps onto each other differ by the ascents' accuracy, a few per cent where the
# sensitivity is flat.
# Poses that one program weighs as quickly as several programs would, a part of them each.
FEW_POSES = 200
MERGING = ((0.1, 1e-3), (0.03, 1e-3), (0.01, 1e-4), (0.001, 1e-5), (0.0, 1e-5))
ROUNDS = 40  # passes over the candidates, or searches over all poses, at most
NEAR_OPTIMAL = 100  # candidates per multiplier that stay beside the support when others are dropped
# Of the time, at most: a bound on many candidates that no time is left to weigh is worth little.
SHARE_OF_DRAWING = 0.25
SHARE_WITHOUT_CELL = 0.5  # of the time for a bound, at most: the rest is for that with the cell
SHARE_OF_BOUND = 0.5  # of the time for a plan, at most, that its bound may take
MERGING_SHARE = 0.5  # of the tolerance, which merging support points may spend
# Accuracies relative to the present gap of the bound: of an ascent, and of the relaxation over the
# poses found so far. A sharper one would be spent on multipliers that the next poses change.
ASCENT_ACCURACY = 1e-3
ACTIVE_GAP = 0.03
# Accuracy that every ascent has, whatever the gap is: a run may be stopped after any search, and
# its bound then says that no pose is more sensitive. `edtk verify` finds one that is so by 1e-3.
LEAST_ACCURACY = 1e-4


class MemoryLimitError(ValueError):
    """The limit on memory leaves no room for candidates.

    Attributes:
        limit_mb: The limit [MB].
        least_mb: The least limit that is enough [MB].
    """

    def __init__(self, limit_mb: float, least_mb: float) -> None:
        super().__init__(
            f"a memory limit of {limit_mb:g} MB is too small, expected {least_mb:g} MB or more"
        )
        self.limit_mb = limit_mb
        self.least_mb = least_mb


def capacity(doubles: int, variables: int, memory_mb: float) -> int:
    """Count the candidates that fit below a limit on memory.

    Each has its information, a scaled copy of that, its design variables and its sensitivities.

    Args:
        doubles: Numbers of a candidate's information, see `DesignSpace.doubles`.
        variables: Number of design variables of an experiment.
        memory_mb: Limit on memory [MB], for the whole process.

    Raises:
        MemoryLimitError: Fewer fit than are worth holding.
    """
    bytes_each = 8 * (2 * doubles + variables + DOUBLES_PER_CANDIDATE)
    fit = (memory_mb - BASE_MB) * 1e6 / bytes_each
    if not fit >= KEPT:  # also where the limit is not a number
        raise MemoryLimitError(memory_mb, np.ceil(BASE_MB + KEPT * bytes_each / 1e6))
    return int(min(fit, 2**62))


def never(plan: RelaxedPlan) -> bool:
    """Do not stop early."""
    return False


@dataclass(frozen=True)
class RelaxOptions:
    """Accuracies, limits and callbacks of `relax_poses`.

    Attributes:
        gap: Relative gap to prove on the candidates.
        tolerance: Relative gap at which the search over the continuum ends. Half of it may be spent
            on merging support points.
        memory_mb: Limit on memory [MB].
        workers: The processes that go over candidates beyond memory; of one, this process's
            threads.
        progress: Called with the name of the stage and its relative gap.
        stop: Asked after each search over all poses whether its bound is enough.
    """

    gap: float = 1e-6
    tolerance: float = 1e-5
    memory_mb: float = DEFAULT_MB
    workers: Workers = THIS_PROCESS
    progress: Callable[[str, float], object] = no_progress
    stop: Callable[[RelaxedPlan], bool] = never


@dataclass(frozen=True, eq=False)
class ActiveSet:
    """Poses, the relaxation over them, and what it took.

    Attributes:
        poses: The poses (n).
        relaxation: The relaxation over them.
        iterations: Number of restricted master problems that were solved from the beginning.
    """

    poses: Candidates
    relaxation: Relaxation
    iterations: int

    @property
    def support(self) -> Candidates:
        """The poses (k) that carry weight."""
        return self.poses[self.relaxation.support]

    @property
    def weights(self) -> Array:
        """The weights (k,) of the support."""
        return self.relaxation.weights[self.relaxation.support]

    def over(self, poses: Candidates, gap: float) -> "ActiveSet":
        """The relaxation over other poses, to a relative gap."""
        earlier = self.relaxation
        few = earlier.criterion.smooth and len(poses.x) <= FEW_POSES
        options = SolverOptions(batch=len(poses.x) if few else None, few=False)
        relaxation = relax(
            poses.problem, earlier.criterion, gap, options, multipliers=earlier.multipliers
        )
        return ActiveSet(poses, relaxation, self.iterations + relaxation.iterations)

    def merged(self, loss: float, gap: float, found: Candidates | None = None) -> "ActiveSet":
        """The relaxation over fewer poses, at hardly any more cost.

        Poses of little weight are dropped, and of poses with like information one stays. Such poses
        are the same, or a symmetry of robot and load maps them onto each other. The one that joined
        last stays, or that the search found last: it is closest to the optimum.

        Args:
            loss: Relative increase of the cost that is allowed.
            gap: Relative gap of the relaxations.
            found: Poses that the search found last, to choose from besides the support.

        Returns:
            The relaxation over fewer poses, or this one where no merging keeps to the loss.
        """
        support = self.support
        weights = self.weights
        M = support.problem.information(weights)
        criterion = self.relaxation.criterion
        # Poses that tell the same of what counts may differ in what else they tell, which may be
        # needed to know what counts: the second choice.
        whiteners = [criterion.whitener(M)]
        if not criterion.needs_all:
            whiteners.append(range_whitener(M))
        for (alike, least), T in product(MERGING, whiteners):
            heavy = np.flatnonzero(weights > least * weights.max())
            last_first = support[heavy[::-1]]
            trials = [last_first] if found is None else [last_first, found + last_first]
            for poses in trials:
                if out_of_time():
                    return self
                kept = distinct(poses.problem.blocks(), T, alike)
                try:
                    fewer = self.over(poses[kept], gap)
                except RankDeficientError:
                    continue
                if fewer.relaxation.cost <= self.relaxation.cost * (1 + loss):
                    has_fewer = len(fewer.relaxation.support) < len(weights)
                    return fewer if has_fewer else self
        return self


class BestPlan:
    """The result of a run when it ends or is interrupted.

    Args:
        source: Where the candidates come from.
        criterion: What is minimised.

    Attributes:
        plan: The best certified plan, or None before there is one.
    """

    def __init__(self, source: CandidateSource, criterion: Relaxable) -> None:
        self.source = source
        self.criterion = criterion
        self.plan: RelaxedPlan | None = None
        self._seconds = {"candidates": 0.0, "solve": 0.0, "continuous": 0.0}
        self._since = perf_counter()

    def spend(self, stage: str) -> None:
        """Add the time since the last call to a stage."""
        now = perf_counter()
        spent = self._seconds[stage] + now - self._since
        self._seconds = self._seconds | {stage: spent}
        self._since = now

    def certify(
        self,
        active: ActiveSet,
        candidates: int,
        proved: LargestSensitivities,
        searched: LargestSensitivities | None = None,
        design: ActiveSet | None = None,
        multipliers: Array | None = None,
    ) -> RelaxedPlan:
        """Make the plan of an active set, with the bounds that its multipliers prove.

        Args:
            active: The active set; its design is the plan's unless another one is given.
            candidates: Number of candidates.
            proved: The largest sensitivities of these candidates.
            searched: The largest sensitivities that a search has found.
            design: A design on fewer poses.
            multipliers: What the sensitivities are to, if not to those of the active set.
        """
        Z = active.relaxation.multipliers if multipliers is None else multipliers
        design = design or active
        support = design.support
        M = support.problem.information(design.weights)
        # The bound has to hold for this design, too, whose poses may not be candidates.
        proved = proved.or_larger(LargestSensitivities.over(support, self.criterion, Z))
        searched = None if searched is None else searched.or_larger(proved)
        proved_bound, searched_bound = self._bounds(M, Z, proved, searched)
        self.plan = RelaxedPlan(
            source=self.source,
            candidates=candidates,
            criterion=self.criterion,
            x=support.x,
            weights=design.weights,
            cost=float(self.criterion.cost(M)),
            proved_bound=proved_bound,
            searched_bound=searched_bound,
            multipliers=Z,
            proved_sensitivities=proved,
            searched_sensitivities=searched,
            solver=design.relaxation.solver,
            iterations=active.iterations,
            seconds=self._seconds,
        )
        return self.plan

    def improve(
        self, active: ActiveSet, earlier: RelaxedPlan, searched: LargestSensitivities
    ) -> RelaxedPlan:
        """The plan of an active set with the multipliers of an earlier one, where they prove more.

        Args:
            active: The active set, whose own multipliers have made the plan so far.
            earlier: The plan before it.
            searched: The largest sensitivities to its multipliers that are known by now.
        """
        own = self.plan
        assert own is not None
        proved = earlier.proved_sensitivities
        Z = earlier.multipliers
        other = self.certify(active, own.candidates, proved, searched, multipliers=Z)
        if other.best_bound.cost < own.best_bound.cost:
            self.plan = own
        return own if self.plan is own else other

    def _bounds(
        self,
        M: Array,
        multipliers: Array,
        proved: LargestSensitivities,
        searched: LargestSensitivities | None,
    ) -> tuple[Bound, Bound | None]:
        """The bounds that multipliers (r, p, p) prove near a design M (p, p)."""

        def bound(largest: LargestSensitivities, kind: BoundKind) -> Bound:
            cost = self.criterion.lower_bound(multipliers, largest.values, M)
            return Bound.of(self.criterion, cost, float(self.criterion.cost(M)), kind)

        on_candidates = bound(proved, BoundKind.PROVED_ON_CANDIDATES)
        return on_candidates, None if searched is None else bound(searched, BoundKind.SEARCHED)


class PlanInterrupted(KeyboardInterrupt):
    """The user has interrupted the run; `best` is the best certified plan so far."""

    def __init__(self, best: RelaxedPlan) -> None:
        super().__init__("interrupted")
        self.best = best


def relax_poses(
    source: CandidateSource,
    n: int,
    criterion: Criterion,
    continuous: bool = False,
    options: RelaxOptions = RelaxOptions(),
    known: Array | None = None,
    beyond: RelaxedPlan | None = None,
) -> RelaxedPlan:
    """Find the best weights over candidate poses, and on request over all feasible poses.

    There are up to three stages. Candidates that fit in memory are solved by `relax`. Candidates
    beyond the limit are generated anew in chunks, and those of largest sensitivity join, until no
    sensitivity is larger than the gap allows. In the continuum, ascents from many starts find poses
    of largest sensitivity, which join in the same way; at last equivalent poses are merged.

    In a cell all poses are free, and so the bound is on plans of free poses: "with the cell". The
    same is found once more without the cell, see `RelaxedPlan.without_cell`.

    Args:
        source: Where candidates come from, with model and feasible set.
        n: Number of candidates.
        criterion: A criterion that can be relaxed.
        continuous: Whether to search over all feasible poses as well.
        options: Accuracies, limits and callbacks.
        known: Feasible experiments (k, v) with which the search over all poses begins besides;
            with a cell, that without it.
        beyond: The relaxation without the cell, where it is known already.

    Raises:
        MemoryLimitError, EmptyFeasibleSetError: There is no room for candidates, or there are none.
        RankDeficientError: The candidates cannot identify all parameters.
        RelaxationError: No solver finds a design.
        NotImplementedError: The criterion cannot be relaxed.
        PlanInterrupted: Ctrl-C after a first certified plan, which it carries.
    """
    if source.space.clear is None:
        return _relax_poses(source, n, criterion, continuous, options, known)
    # Poses that touch something may tell more: the bound over all of them is another question,
    # which certificates are about, as they know no cell.
    interrupted = False
    if beyond is None:
        try:
            with time_limit(SHARE_WITHOUT_CELL * time_left()):
                beyond = _relax_poses(source.without_cell, n, criterion, continuous, options, known)
        except PlanInterrupted as interrupt:
            beyond = interrupt.best
            interrupted = True
    try:
        with time_limit(0.0 if interrupted else np.inf):
            free = _relax_poses(source, n, criterion, continuous, options)
    except PlanInterrupted as interrupt:
        free = interrupt.best
        interrupted = True
    found = replace(free, without_cell=beyond)
    if interrupted:
        raise PlanInterrupted(found)
    return found


def _relax_poses(
    source: CandidateSource,
    n: int,
    criterion: Criterion,
    continuous: bool,
    options: RelaxOptions,
    known: Array | None = None,
) -> RelaxedPlan:
    """`relax_poses` in one space."""
    require_some(n)
    fit = capacity(source.space.doubles, source.space.size, options.memory_mb)
    relaxable = require_relaxable(criterion)
    run = _Run(source, n, relaxable, options, BestPlan(source, relaxable))
    try:
        run.all_stages(min(n, fit), continuous, known)
    except PassCutOffError:
        pass  # the bound on the candidates of the last whole pass is the best so far
    except KeyboardInterrupt as interrupt:
        if run.best.plan is None:
            raise
        raise PlanInterrupted(run.best.plan) from interrupt
    assert run.best.plan is not None
    return run.best.plan


def relaxed_in_time(
    source: CandidateSource, n: int, criterion: Criterion, options: RelaxOptions
) -> tuple[RelaxedPlan, bool]:
    """The relaxation over all poses from which a plan is searched: it has a share of the time.

    Returns:
        The relaxation, and whether Ctrl-C has ended it.

    Raises:
        KeyboardInterrupt: Ctrl-C before a first certified plan.
    """
    try:
        with time_limit(SHARE_OF_BOUND * time_left()):
            return relax_poses(source, n, criterion, True, options), False
    except PlanInterrupted as interrupt:
        return interrupt.best, True


@dataclass(frozen=True, eq=False)
class _Run:
    """One call of `relax_poses`: its stages, each of which leaves a certified plan in `best`."""

    source: CandidateSource
    n: int
    criterion: Relaxable
    options: RelaxOptions
    best: BestPlan

    def all_stages(self, fit: int, continuous: bool, known: Array | None = None) -> None:
        """Carry out the stages that are needed where so many candidates fit in memory."""
        head = self.take(fit)
        active = self.solve(head)
        if out_of_time():
            return
        beyond_memory = self.n > fit
        if beyond_memory or continuous:
            active = self.drop_others(active)
        if beyond_memory:
            active = self.solve_beyond_memory(active)
        if continuous:
            if known is not None:
                joining = Candidates(known, self.source.space.problem(known))
                active = active.over(active.poses + joining, self.options.gap)
            self.solve_continuum(active, head)

    def take(self, n: int) -> Candidates:
        """Generate the first n candidates, which are held in memory; fewer where time is short."""
        self.options.progress("candidates", 1.0)
        with time_limit(SHARE_OF_DRAWING * time_left()):
            head = self.source.take(n, in_time=True)
        self.best.spend("candidates")
        return head

    def solve(self, head: Candidates) -> ActiveSet:
        """First stage: the relaxation over the candidates in memory."""
        interrupted = False
        try:
            relaxation = relax(
                head.problem,
                self.criterion,
                self.options.gap,
                progress=lambda iterations, gap: self.options.progress("solve", gap),
            )
        except RelaxationInterrupted as interrupt:
            # Its certified design becomes a plan before the interruption goes on.
            relaxation = interrupt.best
            interrupted = True
        active = ActiveSet(head, relaxation, relaxation.iterations)
        largest = self._largest(head, relaxation.multipliers)
        self.best.spend("solve")
        self.best.certify(active, len(head.x), largest)
        if interrupted:
            raise KeyboardInterrupt
        return active

    def drop_others(self, active: ActiveSet) -> ActiveSet:
        """The relaxation over the support and a few candidates of large sensitivity."""
        relaxation = active.relaxation
        problem = normalised(active.poses.problem, self.criterion)
        near, _ = most_sensitive(problem.sensitivities(relaxation.multipliers), NEAR_OPTIMAL)
        return active.over(active.poses[np.union1d(relaxation.support, near)], self.options.gap)

    def solve_beyond_memory(self, active: ActiveSet) -> ActiveSet:
        """Second stage: pass after pass over all candidates, until the gap is proved for them."""
        for _ in range(ROUNDS):
            largest, joining = self._sweep(active.relaxation.multipliers)
            self.best.spend("solve")
            plan = self.best.certify(active, self.n, largest)
            self.options.progress("solve", plan.gap)
            if plan.gap <= self.options.gap or out_of_time():
                break
            active = active.over(active.poses + joining, self.options.gap / 2)
        return active

    def solve_continuum(self, active: ActiveSet, head: Candidates) -> None:
        """Third stage: search after search over all poses, until the gap is below the tolerance."""
        enough = (1 - MERGING_SHARE) * self.options.tolerance
        away = 1.0
        last = active.support
        if out_of_time():
            return
        fresh = self._fresh(0)
        is_new = True
        earlier: RelaxedPlan | None = None
        for turn in range(1, ROUNDS + 1):
            if out_of_time():
                return
            Z = active.relaxation.multipliers
            accuracy = min(ASCENT_ACCURACY * max(away, enough), LEAST_ACCURACY)
            searched, found = search_continuum(
                self.source.space, self.criterion, Z, active.poses, accuracy, fresh, is_new
            )
            if out_of_time():
                return  # ascents that were cut off have not seen the largest sensitivity
            proved = self._largest(head, Z)
            searched = searched.or_larger(self._largest(active.poses, Z))
            self.best.spend("continuous")
            plan = self.best.certify(active, len(head.x), proved, searched)
            away = plan.best_bound.gap
            self.options.progress("continuum", away)
            # A gap that is smaller than the error of the ascents has not been seen yet.
            if away <= enough and accuracy <= self.options.tolerance:
                if is_new:
                    self._merge(active, head, last, proved, searched)
                    return
                # The last search shall not rest on poses that the design was made for.
                fresh = self._fresh(turn)
                is_new = True
            else:
                is_new = False
            earlier = plan = self._or_earlier(plan, earlier, active, found)
            if self.options.stop(plan):
                return
            gap = max(0.5 * self.options.gap, ACTIVE_GAP * away)
            active = self._settled(active.over(active.poses + found, gap), found, gap)
            last = found

    def _or_earlier(
        self,
        plan: RelaxedPlan,
        earlier: RelaxedPlan | None,
        active: ActiveSet,
        found: Candidates,
    ) -> RelaxedPlan:
        """The plan with what earlier multipliers prove, where the last ones prove less.

        Sensitivities to these are the largest of those that were seen then, and of the poses that
        were found since.
        """
        if earlier is None or earlier.searched_sensitivities is None:
            return plan
        known = self._largest(active.poses + found, earlier.multipliers)
        return self.best.improve(active, earlier, known.or_larger(earlier.searched_sensitivities))

    def _settled(self, active: ActiveSet, found: Candidates, gap: float) -> ActiveSet:
        """The relaxation over the design after a descent, and the poses that were found last."""
        support = active.support
        space = self.source.space
        blocks = support.problem.blocks()
        x = settle(space, self.criterion, support.x, active.weights, blocks)
        if x is None:
            return active
        return active.over(Candidates(x, space.problem(x)) + support + found, gap)

    def _fresh(self, turn: int) -> Candidates:
        """Random poses that no other turn has."""
        seed = (*self.source.seeds, turn + 1)
        return fresh_poses(self.source.space, seed)

    def _merge(
        self,
        active: ActiveSet,
        head: Candidates,
        last: Candidates,
        proved: LargestSensitivities,
        searched: LargestSensitivities,
    ) -> None:
        """End the third stage with a design on as few poses as the tolerance allows."""
        if self.n > len(head.x):
            # Until now the bound was proved on the candidates in memory alone.
            of_all, _ = self._sweep(active.relaxation.multipliers)
            proved = proved.or_larger(of_all)
        loss = MERGING_SHARE * self.options.tolerance
        design = active.merged(loss, self.options.gap, last)
        self.best.spend("continuous")
        self.best.certify(active, self.n, proved, searched, design)

    def _largest(self, candidates: Candidates, multipliers: Array) -> LargestSensitivities:
        """The largest sensitivities of some candidates."""
        return LargestSensitivities.over(candidates, self.criterion, multipliers)

    def _sweep(self, multipliers: Array) -> tuple[LargestSensitivities, Candidates]:
        """The largest sensitivities of all candidates, and the candidates that should join."""
        workers = self.options.workers
        return sweep_candidates(self.source, self.n, self.criterion, multipliers, KEPT, workers)
