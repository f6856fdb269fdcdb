"""Column generation: one small convex program after another, over a few candidates each."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from criteria import Relaxable
from criteria.linalg.estimable import open_directions, range_whitener
from criteria.linalg.inverse import root, whitener
from edtk.design.problem import Problem
from edtk.design.relaxation.master_equations import leverages
from edtk.design.relaxation.masters import Masters, has_own_method
from edtk.design.relaxation.proof import Proof, Step, WarmStart, experiment_blocks
from edtk.design.relaxation.restricted_master import (
    FINEST,
    INNER,
    NEWTON,
    Effort,
    RelaxationError,
    SolverOptions,
    is_clearly_regular,
)
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices, Mask

# Candidates per one that enters from which on the choice is spread over parts of the list.
SPREAD_FROM = 20
# Sensitivities of a long list among which the largest are looked for first, and how many more of
# them than needed set the threshold for the others.
ENTERING_SAMPLE = 10_000
OVERSAMPLED = 8
# Among so many candidates the choice takes milliseconds; among all of a million it would take
# longer than the relaxation itself.
FIRST_SAMPLE = 2000
# Part of the mean of all candidates from which the greedy choice starts: M is regular from the
# beginning, whatever the sample, and the mean soon no longer matters.
REGULARISATION = 1e-6
# Gap that a program solved to a few digits can still prove; a smaller one needs an exact solution.
COARSE = 1e-3
# A candidate leaves if its weight is below this part of the largest, its leverage below this part
# of one, and its sensitivity below the mean by more than so many gaps.
LIGHT_TO_LEAVE = 1e-4
GAPS = 2.0
# Of a criterion with kinks, those stay whose weight is above this part of the largest, and others,
# until there are so many batches. None leaves unless a step has left this part of the gap at most:
# the rounds would go in circles.
HEAVY_TO_STAY = 1e-3
BATCHES_KEPT = 2
LEFT_OF_GAP = 0.5


def entering_candidates(sensitivities: Array, active: Indices, batch: int) -> Indices:
    """Choose which candidates enter the restricted master problem.

    The candidates of largest sensitivity are often alike. In a long list, a quarter of those that
    enter have the largest sensitivities of all; the others have the largest ones of as many equal
    parts of the list.

    Args:
        sensitivities: Sensitivities (n,) of all candidates.
        active: Candidates (k,) that are in the problem already.
        batch: Number of candidates to choose, at most.

    Returns:
        Indices of candidates that are not active, the largest sensitivity first.
    """
    n = len(sensitivities)
    size = min(batch + len(active), n)
    is_active = np.zeros(n, dtype=bool)
    is_active[active] = True
    largest = _largest(sensitivities, size)
    chosen = _inactive_by_sensitivity(sensitivities, is_active, largest)
    parts = 3 * batch // 4
    if parts and n >= SPREAD_FROM * batch:
        width = n // parts
        in_parts = sensitivities[: width * parts].reshape(parts, width)
        spread = in_parts.argmax(axis=1) + width * np.arange(parts)
        # No two of the spread ones are the same; those of both kinds are marked to count once.
        first = chosen[: batch - parts]
        is_active[first] = True
        others = np.sort(np.concatenate([first, spread[~is_active[spread]]]))
        chosen = others[np.argsort(-sensitivities[others], kind="stable")]
    return chosen[:batch]


def _largest(sensitivities: Array, size: int) -> Indices:
    """Indices of the largest sensitivities, in any order."""
    n = len(sensitivities)
    stride = n // ENTERING_SAMPLE
    if stride > 1 and size * OVERSAMPLED < ENTERING_SAMPLE:
        # A sample tells which sensitivities are too small to count; few others are left to compare.
        sample = sensitivities[::stride]
        rank = len(sample) - 1 - OVERSAMPLED * max(1, size // stride)
        least = np.partition(sample, rank)[rank]
        found = np.flatnonzero(sensitivities >= least)
        if len(found) >= size:
            return found[np.argpartition(-sensitivities[found], size - 1)[:size]]
    return np.argpartition(-sensitivities, size - 1)[:size]


def _inactive_by_sensitivity(sensitivities: Array, is_active: Mask, chosen: Indices) -> Indices:
    """Those of chosen candidates that are not active, the largest sensitivity first."""
    inactive = np.sort(chosen[~is_active[chosen]])
    return inactive[np.argsort(-sensitivities[inactive], kind="stable")]


def first_active_set(problem: Problem, size: int) -> Indices:
    """Choose candidates that together identify every parameter, for the first restricted master.

    One after another the candidate of the largest sensitivity to ``M^-1`` is taken, which is the
    one that raises det M most. The choice is among an evenly spaced sample of the candidates, or
    among all of them if the sample leaves a direction of the parameters open.

    Args:
        problem: Candidates that identify all parameters.
        size: Number of candidates to choose; at least as many as a model has parameters are taken.

    Returns:
        Indices (k,), in the order of the choice.
    """
    known = _known.setdefault(problem, {})
    if size not in known:
        known[size] = _chosen(problem, size)
    return known[size]


# Several criteria of one problem begin with the same candidates; they are forgotten with it.
_known: WeakKeyDictionary[Problem, dict[int, Indices]] = WeakKeyDictionary()


def _chosen(problem: Problem, size: int) -> Indices:
    """The candidates of `first_active_set`."""
    every = np.arange(problem.n)
    sample = np.linspace(0, problem.n - 1, min(problem.n, FIRST_SAMPLE)).astype(int)
    for among in (sample, every):
        part = problem[among] if len(among) < problem.n else problem
        chosen = _most_informative(part, problem.mean, min(max(size, problem.width), part.n))
        if not open_directions(experiment_blocks(part, chosen).mean(axis=0), problem.parameters):
            break
    return among[chosen]


def _most_informative(problem: Problem, mean: Array, size: int) -> Indices:
    """Indices (size,) of candidates, each the one that raises det M most beside those before it.

    After a candidate of information ``U'U`` the inverse C of M is ``C - B B'`` with
    ``B = C U' T``, T the whitener of ``I + U C U'``. So the sensitivities fall by those to
    ``B B'``, a matrix of low rank, and no inverse is computed anew.
    """
    T = whitener(mean)
    C = T @ T.T / REGULARISATION
    gain = problem.sensitivities(C)
    chosen: list[int] = []
    for _ in range(size):
        gain[chosen] = -np.inf
        best = int(gain.argmax())
        chosen.append(best)
        B = _lost(C, problem, best)
        C = C - B @ B.T
        gain = gain - problem.sensitivities_to_root(B)
    return np.array(chosen)


def _lost(C: Array, problem: Problem, chosen: int) -> Array:
    """B (p, r): an inverse C (p, p) falls by ``B B'`` where a candidate joins."""
    U = problem.factors(chosen)
    if problem.prior is not None:
        U = np.concatenate([U, root(problem.prior)])
    along = C @ U.T
    return np.asarray(along @ whitener(np.eye(len(U)) + U @ along))


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
            cost = min(cost, step.cost)
            gap = 1 - step.proof.lower_bound / cost
            is_last = gap <= self.gap and (self.gap >= COARSE or not effort.loose)
            yield self._masters.on_heavy(step) if is_last and not effort.loose else step
            can_end = True
            if is_last or out_of_time():
                return
            # After an exact solution a candidate outside has the largest sensitivity, unless the
            # gap is closed: where an active one has it, the solver was not accurate enough.
            inaccurate = gap <= self.gap or bool(sensitivities.argmax() in start.candidates)
            effort = effort.after(step, inaccurate, gap, self.problem.width, gap <= self.gap)
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
        return self.options.batch_of(self.problem.width)

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
        return Effort(solvers, INNER if loose else FINEST)

    def _first_active(self) -> Indices:
        """The candidates to begin with: some that tell all parameters, and the most sensitive."""
        # A choice one after another takes its time; as many as there are parameters will do.
        chosen = first_active_set(self.problem, self.problem.width)
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
            found = self._pool(step, sensitivities) if gap <= LEFT_OF_GAP * least else every
        # The best design may be singular; light candidates keep the others regular.
        M = self.problem[found[0]].information(found[1])
        return found if self.criterion.needs_all and is_clearly_regular(M) else every

    def _worth_keeping(self, step: Step, sensitivities: Array, gap: float) -> tuple[Indices, Array]:
        """The candidates of some weight or sensitivity, with their weights."""
        own = sensitivities[step.active]
        mean = float(step.weights @ own)
        near = own > (1 - GAPS * max(gap, self.gap)) * mean
        heavy = step.weights > LIGHT_TO_LEAVE * step.weights.max()
        carried = leverages(self.problem[step.active], step.weights, step.M)
        kept = np.asarray(heavy | near | (carried > LIGHT_TO_LEAVE))
        return step.active[kept], step.weights[kept]

    def _pool(self, step: Step, sensitivities: Array) -> tuple[Indices, Array]:
        """The candidates of much weight, and the most sensitive of the others, with their weights.

        Multipliers of criteria with kinks jump: a candidate that has left would soon be back, and
        so a few stay that have no weight.
        """
        weights = step.last.weights
        heavy = weights > HEAVY_TO_STAY * weights.max()
        others = np.flatnonzero(~heavy)
        room = max(0, BATCHES_KEPT * self._batch - int(heavy.sum()))
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
        tried = [] if Z is None else [Z]
        if Z is None or self.criterion.smooth:
            found, G = self.criterion.cost_and_gradient(M)
            tried.insert(0, -G)
        else:
            found = self.criterion.cost(M)
        cost = float(found)
        enough = cost * (1 - FINEST)
        proof, sensitivities = Proof.of(self.problem, self.criterion, M, tried, enough)
        if before is not None and not proof.lower_bound > before.proof.lower_bound:
            proof = before.proof
        carries = weights > 0
        last = WarmStart(active, weights, Z)
        step = Step(active[carries], weights[carries], M, cost, proof, solver, last)
        return step, sensitivities
