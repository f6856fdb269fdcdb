"""The relaxation over poses: candidates in memory, candidates beyond it, and all feasible poses."""

from dataclasses import dataclass

import numpy as np

from criteria import Criterion, Relaxable
from edtk.design.candidate_source import CandidateSource, require_some
from edtk.design.candidates import Candidates
from edtk.design.relaxation.active_set import ActiveSet
from edtk.design.relaxation.best_plan import BestPlan
from edtk.design.relaxation.capacity import KEPT, capacity
from edtk.design.relaxation.largest_sensitivities import LargestSensitivities
from edtk.design.relaxation.normalised import normalised
from edtk.design.relaxation.relax import RelaxationInterrupted, relax, require_relaxable
from edtk.design.relaxation.relax_options import RelaxOptions
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.design.relaxation.search_continuum import fresh_poses, search_continuum
from edtk.design.relaxation.settle import settle
from edtk.design.relaxation.sweep_candidates import most_sensitive, sweep_candidates
from edtk.system.time_limit import out_of_time, time_left, time_limit
from edtk.system.typing import Array

ROUNDS = 40  # passes over the candidates, or searches over all poses, at most
NEAR_OPTIMAL = 100  # candidates per multiplier that stay beside the support when others are dropped
SHARE_OF_BOUND = 0.5  # of the time for a plan, at most, that its bound may take
MERGING_SHARE = 0.5  # of the tolerance, which merging support points may spend
# Accuracies relative to the present gap of the bound: of an ascent, and of the relaxation over the
# poses found so far. A sharper one would be spent on multipliers that the next poses change.
ASCENT_ACCURACY = 1e-3
ACTIVE_GAP = 0.03
# Accuracy that every ascent has, whatever the gap is: a run may be stopped after any search, and
# its bound then says that no pose is more sensitive. `edtk verify` finds one that is so by 1e-3.
LEAST_ACCURACY = 1e-4


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
    options: RelaxOptions = RelaxOptions(),  # noqa: B008, frozen
) -> RelaxedPlan:
    """Find the best weights over candidate poses, and on request over all feasible poses.

    There are up to three stages. Candidates that fit in memory are solved by `relax`. Candidates
    beyond the limit are generated anew in chunks, and those of largest sensitivity join, until no
    sensitivity is larger than the gap allows. In the continuum, ascents from many starts find poses
    of largest sensitivity, which join in the same way; at last equivalent poses are merged.

    Args:
        source: Where candidates come from, with model and feasible set.
        n: Number of candidates.
        criterion: A criterion that can be relaxed.
        continuous: Whether to search over all feasible poses as well.
        options: Accuracies, limits and callbacks.

    Raises:
        MemoryLimitError, EmptyFeasibleSetError: There is no room for candidates, or there are none.
        RankDeficientError: The candidates cannot identify all parameters.
        RelaxationError: No solver finds a design.
        NotImplementedError: The criterion cannot be relaxed.
        PlanInterrupted: Ctrl-C after a first certified plan, which it carries.
    """
    require_some(n)
    fit = capacity(source.space.doubles, source.space.size, options.memory_mb)
    relaxable = require_relaxable(criterion)
    run = _Run(source, n, relaxable, options, BestPlan(source, relaxable))
    try:
        run.all_stages(min(n, fit), continuous)
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

    def all_stages(self, fit: int, continuous: bool) -> None:
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
            self.solve_continuum(active, head)

    def take(self, n: int) -> Candidates:
        """Generate the first n candidates, which are held in memory."""
        self.options.progress("candidates", 1.0)
        head = self.source.take(n)
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
        for turn in range(1, ROUNDS + 1):
            Z = active.relaxation.multipliers
            accuracy = min(ASCENT_ACCURACY * away, LEAST_ACCURACY)
            searched, found = search_continuum(
                self.source.space,
                self.criterion,
                Z,
                active.poses,
                accuracy,
                fresh,
                is_new,
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
            if self.options.stop():
                return
            gap = max(0.5 * self.options.gap, ACTIVE_GAP * away)
            active = self._settled(active.over(active.poses + found, gap), found, gap)
            last = found

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
        return sweep_candidates(self.source, self.n, self.criterion, multipliers, KEPT)
