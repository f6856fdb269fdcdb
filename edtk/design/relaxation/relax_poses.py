"""Relaxation over poses: candidates in memory, candidates beyond it in chunks, and the continuum of poses."""

from collections.abc import Callable
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from criteria import Criterion
from edtk.design.bound import Bound, BoundKind
from edtk.design.candidate_source import CandidateSource, require_some
from edtk.design.candidates import Candidates
from edtk.design.problem import Problem
from edtk.design.relaxation.active_set import ActiveSet
from edtk.design.relaxation.relax import (
    RelaxationInterrupted,
    normalised,
    relax,
    require_relaxable,
)
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.design.relaxation.search_continuum import search_continuum

Array = NDArray[np.float64]
Progress = Callable[[str, float], object]
BASE_MB, MEMORY_MB = 350.0, 1000.0  # the interpreter with its libraries, and the default limit
KEEP = 20_000  # dearest candidates that a pass over the others brings back, per multiplier
ROUNDS = 40


class MemoryLimitError(ValueError):
    """The limit on memory leaves no room for candidates."""


class PlanInterrupted(KeyboardInterrupt):
    """The user interrupted; `best` is the best certified plan so far."""

    def __init__(self, best: RelaxedPlan) -> None:
        super().__init__("interrupted")
        self.best = best


def capacity(p: int, variables: int, memory_mb: float) -> int:
    """How many candidates fit below a limit on memory: their information, a scaled copy, poses and prices.

    Raises:
        MemoryLimitError: Fewer than are worth while.
    """
    each = 8 * (p * (p + 1) + variables + 8)
    fit = (memory_mb - BASE_MB) * 1e6 / each
    if not fit >= KEEP:
        need = np.ceil(BASE_MB + KEEP * each / 1e6)
        raise MemoryLimitError(
            f"a memory limit of {memory_mb:g} MB is too small, expected {need:g} MB or more"
        )
    return int(min(fit, 2**62))


def relax_poses(
    source: CandidateSource,
    n: int,
    criterion: Criterion,
    continuous: bool = False,
    gap: float = 1e-6,
    tolerance: float = 1e-5,
    memory_mb: float = MEMORY_MB,
    progress: Progress = lambda stage, gap: None,
    stop: Callable[[], bool] = lambda: False,
) -> RelaxedPlan:
    """The best weights over the first n candidates of a source, and on request over all feasible poses.

    Candidates beyond the memory limit are never held: they are generated anew and priced in chunks, and the
    dearest come back into a problem that is solved again, until none is dearer than the gap allows. In the continuum
    the dearest poses are found by ascent of the sensitivity from many starts, and join in the same way; support
    points that are the same pose, or equivalent by a symmetry of robot and load, are merged.

    Args:
        source: Where candidates come from, with model and feasible set.
        n: Number of candidates.
        criterion: A criterion with a convex form.
        continuous: Whether to leave the candidates.
        gap: Relative gap to prove on the candidates.
        tolerance: Relative gap at which the search over the continuum ends; half of it may be spent on merging.
        memory_mb: Limit on memory [MB].
        progress: Called with the stage and its relative gap.
        stop: Asked, in the continuum, whether the bound that is proved or searched so far is enough.

    Raises:
        MemoryLimitError: The limit leaves no room for candidates.
        EmptyFeasibleSetError: No feasible pose turns up.
        RankDeficientError: The candidates cannot identify all parameters.
        RelaxationError: No solver finds a design.
        NotImplementedError: The criterion has no convex form.
        PlanInterrupted: Ctrl-C after a first certified plan, which it carries.
    """
    require_some(n)
    run = _Run(source, n, criterion, gap, tolerance, progress)
    fit = capacity(source.space.model.p, source.space.size, memory_mb)
    try:
        head = run.candidates(min(n, fit))
        active = run.solve(head)
        if n > len(head.x) or continuous:
            active = run.reduced(active)
        if n > len(head.x):
            active = run.beyond_memory(active)
        if continuous:
            run.continuum(active, head, stop)
    except KeyboardInterrupt as interrupt:
        if run.best is None:
            raise
        raise PlanInterrupted(run.best) from interrupt
    assert run.best is not None
    return run.best


class _Run:
    """One call of `relax_poses`: its stages, and the best certified plan so far."""

    def __init__(
        self,
        source: CandidateSource,
        n: int,
        criterion: Criterion,
        gap: float,
        tolerance: float,
        progress: Progress,
    ) -> None:
        self.source, self.n, self.criterion = source, n, require_relaxable(criterion)
        self.gap, self.tolerance, self.progress = gap, tolerance, progress
        self.best: RelaxedPlan | None = None
        self.seconds = {"candidates": 0.0, "solve": 0.0, "continuous": 0.0}
        self.since = perf_counter()

    def _spend(self, on: str) -> None:
        """Book the time since the last call."""
        now = perf_counter()
        self.seconds = self.seconds | {on: self.seconds[on] + now - self.since}
        self.since = now

    def _keep(
        self,
        active: ActiveSet,
        n: int,
        tops: Array,
        searched: Array | None = None,
        space: ActiveSet | None = None,
    ) -> RelaxedPlan:
        """The plan whose bounds hold for such dearest prices (r,), of n candidates and of what was searched.

        Multipliers are those of the active poses; the design may be one of fewer of these poses.
        """
        Z, space = active.relaxation.multipliers, space or active
        support = space.support
        M = support.problem.information(space.weights)
        cost = float(self.criterion.cost(M))
        tops = np.maximum(tops, self._tops(support.problem, Z))
        self.best = RelaxedPlan(
            source=self.source,
            candidates=n,
            criterion=self.criterion,
            x=support.x,
            weights=space.weights,
            cost=cost,
            proved_bound=Bound.of(
                self.criterion,
                self.criterion.lower_bound(Z, tops, M),
                cost,
                BoundKind.PROVED_ON_CANDIDATES,
            ),
            searched_bound=None
            if searched is None
            else Bound.of(
                self.criterion,
                self.criterion.lower_bound(Z, np.maximum(searched, tops), M),
                cost,
                BoundKind.SEARCHED,
            ),
            multipliers=Z,
            solver=space.relaxation.solver,
            iterations=active.iterations,
            seconds=self.seconds,
        )
        return self.best

    def candidates(self, n: int) -> Candidates:
        """The first n candidates, in memory."""
        self.progress("candidates", 1.0)
        head = self.source.take(n)
        self._spend("candidates")
        return head

    def solve(self, head: Candidates) -> ActiveSet:
        """The relaxation over candidates in memory."""
        interrupted = False
        try:
            r = relax(
                head.problem,
                self.criterion,
                self.gap,
                progress=lambda _, gap: self.progress("solve", gap),
            )
        except RelaxationInterrupted as interrupt:
            r, interrupted = interrupt.best, True
        active = ActiveSet(head, r, r.iterations)
        tops = self._tops(head.problem, r.multipliers)
        self._spend("solve")
        self._keep(active, len(head.x), tops)
        if interrupted:
            raise KeyboardInterrupt
        return active

    def reduced(self, active: ActiveSet) -> ActiveSet:
        """The relaxation over the support and a few of the dearest poses."""
        r = active.relaxation
        chosen, _ = _dearest(
            normalised(active.poses.problem, self.criterion).sensitivities(r.multipliers), 100
        )
        return active.over(active.poses[np.union1d(r.support, chosen)], self.gap)

    def beyond_memory(self, active: ActiveSet) -> ActiveSet:
        """Pass after pass over all candidates, until none is dearer than the gap allows."""
        for _ in range(ROUNDS):
            tops, dearest = self._sweep(active.relaxation.multipliers)
            self._spend("solve")
            plan = self._keep(active, self.n, tops)
            self.progress("solve", plan.gap)
            if plan.gap <= self.gap:
                break
            active = active.over(active.poses + dearest, self.gap / 2)
        return active

    def continuum(self, active: ActiveSet, head: Candidates, stop: Callable[[], bool]) -> None:
        """Ascent after ascent, until the dearest pose found anywhere is within the tolerance."""
        away, last = 1.0, active.support
        for turn in range(ROUNDS):
            Z = active.relaxation.multipliers
            seed = (*np.atleast_1d(self.source.seed).tolist(), turn + 1)
            searched, found = search_continuum(
                self.source.space, self.criterion, Z, active.poses, 1e-3 * away, seed
            )
            proved = self._tops(head.problem, Z)
            searched = np.maximum(searched, self._tops(active.poses.problem, Z))
            self._spend("continuous")
            plan = self._keep(active, len(head.x), proved, searched)
            away = plan.best_bound.gap
            self.progress("continuum", away)
            if away <= 0.5 * self.tolerance:  # the other half is for merging
                if self.n > len(head.x):
                    proved = np.maximum(proved, self._sweep(Z)[0])
                space = active.merged(0.5 * self.tolerance, self.gap, last)
                self._spend("continuous")
                self._keep(active, self.n, proved, searched, space)
                return
            if stop():
                return
            active, last = (
                active.over(active.poses + found, max(0.5 * self.gap, 0.03 * away)),
                found,
            )

    def _tops(self, problem: Problem, Z: Array) -> Array:
        """Dearest prices (r,) of some candidates."""
        return np.asarray(normalised(problem, self.criterion).sensitivities(Z).max(axis=-1))

    def _sweep(self, Z: Array) -> tuple[Array, Candidates]:
        """Dearest prices (r,) of all candidates, generated anew in chunks, and the dearest candidates."""
        tops, least, kept = np.full(len(Z), -np.inf), np.full(len(Z), -np.inf), None
        for part in self.source.chunks(self.n):
            sensitivities = normalised(part.problem, self.criterion).sensitivities(Z)
            tops = np.maximum(tops, sensitivities.max(axis=-1))
            if not (dear := np.flatnonzero((sensitivities > least[:, None]).any(axis=0))).size:
                continue
            kept = part[dear] if kept is None else kept + part[dear]
            if len(kept.x) > 4 * KEEP * len(Z):
                chosen, least = _dearest(
                    normalised(kept.problem, self.criterion).sensitivities(Z), KEEP
                )
                kept = kept[chosen]
        assert kept is not None
        return tops, kept[
            _dearest(normalised(kept.problem, self.criterion).sensitivities(Z), KEEP)[0]
        ]


def _dearest(sensitivities: Array, size: int) -> tuple[NDArray[np.int_], Array]:
    """Indices of the dearest by each row of prices (r, n), and the least price (r,) among those."""
    size = min(size, sensitivities.shape[1])
    order = np.argpartition(-sensitivities, size - 1, axis=1)[:, :size]
    return np.unique(order), np.take_along_axis(sensitivities, order[:, -1:], axis=1).ravel()
