"""Column generation: one small convex program after another, over a few of the candidates each."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from criteria import Relaxable
from criteria.linalg.estimable import range_whitener
from edtk.design.problem import Problem
from edtk.design.relaxation.effort import EXACT, INNER, Effort
from edtk.design.relaxation.entering_candidates import entering_candidates
from edtk.design.relaxation.first_active_set import first_active_set
from edtk.design.relaxation.leverages import leverages
from edtk.design.relaxation.masters import Masters
from edtk.design.relaxation.own_weights import has_own_method
from edtk.design.relaxation.proof import Proof
from edtk.design.relaxation.restricted_master import RelaxationError, is_clearly_regular
from edtk.design.relaxation.solver_options import LEAST_BATCH, NEWTON, SolverOptions
from edtk.design.relaxation.step import Step
from edtk.design.relaxation.warm_start import WarmStart
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices

# Gap that a program solved to a few digits can still prove; a smaller one needs an exact solution.
COARSE = 1e-3
# A candidate leaves if its weight is below this part of the largest, its leverage below this part
# of one, and its sensitivity below the mean by more than so many gaps.
LIGHT = 1e-4
GAPS = 2.0
# Of a criterion with kinks, those stay whose weight is above this part of the largest, and others,
# until there are so many batches. None leaves unless a step has left this part of the gap at most:
# the rounds would go in circles.
HEAVY = 1e-3
POOL = 2
GAIN = 0.5


@dataclass(frozen=True, eq=False)
class ColumnGeneration:
    """The minimum of one convex program over many candidates, by programs over few of them.

    The restricted master problem has the active candidates alone. Its multiplier gives the
    sensitivities of all candidates, in one matrix product. Those of largest sensitivity enter,
    those without weight leave.

    Attributes:
        problem: The candidates, see `normalised`.
        criterion: What is minimised, with a convex form of its own.
        gap: Relative gap between cost and bound at which to end.
        options: Limits and solvers.
    """

    problem: Problem
    criterion: Relaxable
    gap: float
    options: SolverOptions

    def steps(self, start: WarmStart) -> Iterator[Step]:
        """Solve one restricted master problem after the other, until the gap is proved.

        When the time is over (`time_limit`), no other one is begun.

        Args:
            start: The design to begin with; without candidates, they are chosen here.

        Raises:
            RelaxationError: No solver can solve the first program, and there is no earlier design.
        """
        can_end = len(start) > 0
        start = start if can_end else WarmStart.alike(self._first_active())
        effort = self._first_effort(len(start))
        step = None
        cost = np.inf
        least = 0.0
        for _ in range(self.options.rounds):
            try:
                step, sensitivities = self._step(start, effort, step)
            except RelaxationError:
                if can_end:
                    return
                raise
            cost = min(cost, float(self.criterion.cost(step.M)))
            gap = 1 - step.proof.lower_bound / cost
            is_last = gap <= self.gap and (self.gap >= COARSE or not effort.loose)
            yield self._masters.on_heavy(step) if is_last and not effort.loose else step
            can_end = True
            if is_last or out_of_time():
                return
            # After an exact solution a candidate outside has the largest sensitivity, unless the
            # gap is closed: where an active one has it, the solver was not accurate enough.
            inaccurate = gap <= self.gap or bool(sensitivities.argmax() in start.candidates)
            effort = effort.after(step, inaccurate, gap, self.problem.p, gap <= self.gap)
            if not effort.solvers:
                return
            start = self._next(step, sensitivities, gap, least)
            least = min(gap, least) if least else gap

    def _next(self, step: Step, sensitivities: Array, gap: float, least: float) -> WarmStart:
        """Where the next program starts: those that stay, and those that enter.

        Args:
            step: The last step.
            sensitivities: Sensitivities (n,) of all candidates.
            gap: The gap that the step has left.
            least: The least gap of all steps before it.
        """
        entering = entering_candidates(sensitivities, step.last.candidates, self._batch)
        kept, weights = self._kept(step, sensitivities, gap, least)
        return WarmStart(
            np.concatenate([kept, entering]),
            np.concatenate([weights, np.zeros(len(entering))]),
            step.last.multiplier,
        )

    @property
    def _batch(self) -> int:
        """Candidates that enter per round."""
        return self.options.batch_of(self.problem.p)

    @cached_property
    def _masters(self) -> Masters:
        """The programs over a few candidates."""
        return Masters(self.problem, self.criterion, self.gap, self._batch)

    def _first_effort(self, active: int) -> Effort:
        """The effort for a first program of so many candidates."""
        solvers = self.options.solvers
        if not has_own_method(self.criterion, self.problem.p) and len(solvers) > 1:
            solvers = tuple(solver for solver in solvers if solver != NEWTON)
        # Where the first program holds all candidates, it decides nothing but the answer itself.
        by_newton = solvers[0] == NEWTON
        loose = (self.criterion.convex or by_newton) and active < self.problem.n
        return Effort(solvers, INNER if loose else EXACT)

    def _first_active(self) -> Indices:
        """The candidates to begin with: some that tell all parameters, and the most sensitive."""
        p = self.problem.p
        chosen = first_active_set(self.problem, min(self._batch, max(p, LEAST_BATCH)))
        missing = self._batch - len(chosen)
        if missing <= 0 or len(chosen) == self.problem.n:
            return chosen
        T = range_whitener(self.problem.mean)
        sensitivities = self.problem.sensitivities(T @ T.T)
        return np.concatenate([chosen, entering_candidates(sensitivities, chosen, missing)])

    def _kept(
        self, step: Step, sensitivities: Array, gap: float, least: float
    ) -> tuple[Indices, Array]:
        """Which candidates (k,) of a step stay, and their weights.

        Those leave that have no weight and will hardly get some. For the arguments see `_next`.
        """
        if step.solver != NEWTON:
            return step.active, step.weights
        if self.criterion.smooth:
            every = (step.active, step.weights)
            found = self._worth_keeping(step, sensitivities, gap)
        else:
            every = (step.last.candidates, step.last.weights)
            found = self._pool(step, sensitivities) if gap <= GAIN * least else every
        # The best design may be singular; light candidates keep the others regular.
        M = self.problem[found[0]].information(found[1])
        return found if self.criterion.needs_all and is_clearly_regular(M) else every

    def _worth_keeping(self, step: Step, sensitivities: Array, gap: float) -> tuple[Indices, Array]:
        """The candidates of some weight or sensitivity, with their weights."""
        own = sensitivities[step.active]
        mean = float(step.weights @ own)
        near = own > (1 - GAPS * max(gap, self.gap)) * mean
        heavy = step.weights > LIGHT * step.weights.max()
        carried = leverages(self.problem[step.active], step.weights, step.M)
        kept = np.asarray(heavy | near | (carried > LIGHT))
        return step.active[kept], step.weights[kept]

    def _pool(self, step: Step, sensitivities: Array) -> tuple[Indices, Array]:
        """The candidates of much weight, and the most sensitive of the others, with their weights.

        Multipliers of criteria with kinks jump: a candidate that has left would soon be back, and
        so a few stay that have no weight.
        """
        weights = step.last.weights
        heavy = weights > HEAVY * weights.max()
        others = np.flatnonzero(~heavy)
        room = max(0, POOL * self._batch - int(heavy.sum()))
        candidates = step.last.candidates
        stay = others[np.argsort(-sensitivities[candidates[others]], kind="stable")[:room]]
        kept = np.concatenate([np.flatnonzero(heavy), stay])
        return candidates[kept], weights[kept]

    def _step(self, start: WarmStart, effort: Effort, before: Step | None) -> tuple[Step, Array]:
        """Solve the program over the candidates of a start.

        Returns:
            The step, and the sensitivities (n,) of all candidates to the program's multiplier.
        """
        weights, Z, solver = self._masters.solve(start, effort)
        active = start.candidates
        M = self.problem[active].information(weights)
        proof, sensitivities = Proof.of(self.problem, self.criterion, M, Z)
        if before is not None and not proof.lower_bound > before.proof.lower_bound:
            proof = before.proof
        carries = weights > 0
        last = WarmStart(active, weights, Z)
        return Step(active[carries], weights[carries], M, proof, solver, last), sensitivities
