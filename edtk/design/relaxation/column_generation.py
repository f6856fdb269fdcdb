"""Column generation: one small convex program after another, over a few of the candidates each."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from criteria import Relaxable
from criteria.linalg.estimable import range_whitener
from criteria.linalg.inverse import whitener
from edtk.design.problem import Problem
from edtk.design.relaxation.active_information import ActiveInformation
from edtk.design.relaxation.entering_candidates import entering_candidates
from edtk.design.relaxation.experiment_blocks import experiment_blocks
from edtk.design.relaxation.first_active_set import first_active_set
from edtk.design.relaxation.own_weights import has_own_method, own_weights
from edtk.design.relaxation.restricted_master import (
    RelaxationError,
    is_clearly_regular,
    regular_weights,
    restricted_master_for,
)
from edtk.design.relaxation.solver_options import LEAST_BATCH, NEWTON, SolverOptions
from edtk.system.typing import Array, Indices

# While the gap is above this, cvxpy solves a program to a few digits: its multiplier is good enough
# to say which candidates should enter, and the solver takes fewer iterations.
FAR = 0.05
# Gap that a program solved to a few digits can still prove; a smaller one needs an exact solution.
COARSE = 1e-3
# Accuracy of Newton's method in parts of the gap that the candidates outside leave, and where they
# leave none.
INNER = 0.05
EXACT = 1e-10
# The same of a criterion with kinks, in parts of the gap that is asked for.
EXACT_GAP = 0.01
HEAVY = 1e-4  # weight, in parts of the largest, of candidates that a design shall rest on
LIGHT_LOSS = 0.05  # part of the gap that it may lose by leaving the others
LOST = 1e-3  # share of light weights that are dropped then, likewise
# A candidate leaves if its weight is below this part of the largest, and its sensitivity below the
# mean by more than so many gaps.
LIGHT = 1e-4
GAPS = 2.0
# Batches of candidates that stay in the program of a criterion with kinks.
POOL = 2
# Parameters from which on a program of cvxpy takes longer than anyone waits for the last digit.
TOO_MANY = 40


@dataclass(frozen=True, eq=False)
class Proof:
    """Why no weights of the candidates have a lower cost.

    Attributes:
        multiplier: A multiplier Z (p, p).
        largest: The largest sensitivity ``<Z, M_i>`` of a candidate to it.
        lower_bound: The bound on the cost that both prove.
    """

    multiplier: Array
    largest: float
    lower_bound: float


@dataclass(frozen=True, eq=False)
class Step:
    """One solved restricted master problem.

    Attributes:
        active: Indices (k,) of the candidates that carry weight.
        weights: Their weights (k,), positive, of sum one.
        M: Information matrix (p, p) of these weights.
        proof: The best proof of this and all earlier steps.
        solver: The solver that found the weights.
        candidates: Indices (c,) of all candidates of the problem, with weight or without.
    """

    active: Indices
    weights: Array
    M: Array
    proof: Proof
    solver: str
    candidates: Indices


@dataclass(frozen=True)
class _Effort:
    """How accurately the next program is solved, and by which solvers in turn."""

    solvers: tuple[str, ...]
    accuracy: float

    @property
    def loose(self) -> bool:
        """Whether an answer to a few digits will do."""
        return self.accuracy > EXACT

    def after(self, step: Step, inaccurate: bool, gap: float, p: int) -> "_Effort":
        """The effort for the next program: more where the last answer was too inaccurate."""
        solvers = self.solvers
        if inaccurate and not self.loose:
            solvers = self.solvers[self.solvers.index(step.solver) + 1 :]
            if step.solver == NEWTON and p > TOO_MANY:
                solvers = ()
        by_newton = step.solver == NEWTON
        can_be_loose = self.loose and not inaccurate and (by_newton or gap > FAR)
        return _Effort(solvers, max(INNER * gap, EXACT) if can_be_loose else EXACT)


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

    def steps(self, active: Indices) -> Iterator[Step]:
        """Solve one restricted master problem after the other, until the gap is proved.

        Args:
            active: Candidates (k,) of a design to begin with; without any they are chosen here.

        Raises:
            RelaxationError: No solver can solve the first program, and there is no earlier design.
        """
        can_end = len(active) > 0
        active = active if can_end else self._first_active()
        solvers = self.options.solvers
        if not has_own_method(self.criterion, self.problem.p) and len(solvers) > 1:
            solvers = tuple(solver for solver in solvers if solver != NEWTON)
        # Where the first program holds all candidates, it decides nothing but the answer itself.
        by_newton = solvers[0] == NEWTON
        loose = (self.criterion.convex or by_newton) and len(active) < self.problem.n
        effort = _Effort(solvers, INNER if loose else EXACT)
        start = np.full(len(active), 1.0 / len(active))
        step = None
        cost = np.inf
        for _ in range(self.options.rounds):
            try:
                step, sensitivities = self._step(active, start, effort, step)
            except RelaxationError:
                if can_end:
                    return
                raise
            cost = min(cost, float(self.criterion.cost(step.M)))
            gap = 1 - step.proof.lower_bound / cost
            is_last = gap <= self.gap and (self.gap >= COARSE or not effort.loose)
            yield self._on_heavy(step) if is_last and not effort.loose else step
            can_end = True
            if is_last:
                return
            # After an exact solution a candidate outside has the largest sensitivity, unless the
            # gap is closed: where an active one has it, the solver was not accurate enough.
            inaccurate = gap <= self.gap or bool(sensitivities.argmax() in active)
            effort = effort.after(step, inaccurate, gap, self.problem.p)
            if not effort.solvers:
                return
            entering = entering_candidates(sensitivities, active, self._batch)
            kept, weights = self._kept(step, sensitivities, gap)
            active = np.concatenate([kept, entering])
            start = np.concatenate([weights, np.zeros(len(entering))])

    @property
    def _batch(self) -> int:
        """Candidates that enter per round."""
        return self.options.batch_of(self.problem.p)

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

    def _kept(self, step: Step, sensitivities: Array, gap: float) -> tuple[Indices, Array]:
        """Which candidates (k,) of a step stay, and their weights.

        Those leave that have no weight and will hardly get some.
        """
        if step.solver != NEWTON:
            return step.active, step.weights
        if not self.criterion.smooth:
            return self._pool(step, sensitivities)
        own = sensitivities[step.active]
        mean = float(step.weights @ own)
        near = own > (1 - GAPS * max(gap, self.gap)) * mean
        kept = np.asarray((step.weights > LIGHT * step.weights.max()) | near)
        # The best design may be singular; light candidates keep the others regular.
        part = self.problem[step.active[kept]].information(step.weights[kept])
        if not self.criterion.needs_all or not is_clearly_regular(part):
            kept = np.ones_like(kept)
        return step.active[kept], step.weights[kept]

    def _pool(self, step: Step, sensitivities: Array) -> tuple[Indices, Array]:
        """All candidates of a step, as long as they are not too many, with their weights.

        Multipliers of criteria with kinks jump: a candidate that has left would soon be back.
        """
        others = np.setdiff1d(step.candidates, step.active)
        room = max(0, POOL * self._batch - len(step.active))
        others = others[np.argsort(-sensitivities[others], kind="stable")][:room]
        return (
            np.concatenate([step.active, others]),
            np.concatenate([step.weights, np.zeros(len(others))]),
        )

    def _step(
        self, active: Indices, start: Array, effort: _Effort, before: Step | None
    ) -> tuple[Step, Array]:
        """Solve the program over the active candidates.

        Returns:
            The step, and the sensitivities (n,) of all candidates to the program's multiplier.
        """
        weights, Z, solver = self._solve(active, start, effort)
        M = self.problem[active].information(weights)
        proof, sensitivities = self._prove(M, Z)
        if before is not None and not proof.lower_bound > before.proof.lower_bound:
            proof = before.proof
        carries = weights > 0
        step = Step(active[carries], weights[carries], M, proof, solver, active)
        return step, sensitivities

    def _solve(
        self, active: Indices, start: Array, effort: _Effort
    ) -> tuple[Array, Array | None, str]:
        """Weights (k,) of the active candidates, their multiplier (p, p), and the solver.

        Without a multiplier minus the gradient is one.
        """
        solvers = effort.solvers
        failure = ""
        if solvers[0] == NEWTON:
            try:
                return *self._by_newton(active, start, effort.accuracy), NEWTON
            except RelaxationError as error:
                if len(solvers) == 1:
                    raise
                failure = str(error)
                solvers = solvers[1:]
        blocks = experiment_blocks(self.problem, active)
        size = max(2 * self._batch, len(active))
        entering = start == 0
        around = np.tensordot(start, blocks, axes=1)
        # The design that the program is whitened by: near its optimum, and regular.
        if entering.any():
            around = 0.5 * (around + blocks[entering].mean(axis=0))
        if not is_clearly_regular(around):
            around = 0.5 * (around + self.problem.mean)
        program = restricted_master_for(self.criterion, around, size)
        try:
            return program.solve_by_first(blocks, solvers, effort.loose)
        except RelaxationError as error:
            raise RelaxationError(f"{failure}; {error}" if failure else str(error)) from error

    def _by_newton(
        self, active: Indices, start: Array, accuracy: float
    ) -> tuple[Array, Array | None]:
        """Weights (k,), and a multiplier where minus the gradient is none."""
        try:
            information = ActiveInformation.of(self.problem, active)
            if not self.criterion.smooth:
                accuracy = max(accuracy, EXACT_GAP * self.gap)
            found, Z = own_weights(self.criterion, information, start, accuracy)
        except (np.linalg.LinAlgError, ValueError, ArithmeticError) as error:
            raise RelaxationError(f"{NEWTON}: {' '.join(str(error).split())}") from error
        # Where a cost has kinks, many light weights together are worth more than each of them.
        lost = None if self.criterion.smooth else LOST * self.gap
        weights = regular_weights(self.criterion, information, found, NEWTON, lost)
        if Z is None and accuracy <= EXACT and (weights == 0).any():
            # Without its light candidates a design may prove less than the gap that is asked for.
            Z = np.asarray(-self.criterion.gradient(information.information(found)))
        return weights, Z

    def _on_heavy(self, step: Step) -> Step:
        """A design on the candidates of much weight alone, if it is as good.

        Where a cost has kinks, an interior point leaves weights of the size of its accuracy on many
        candidates, which the others must take over.
        """
        heavy = step.active[step.weights > HEAVY * step.weights.max()]
        if self.criterion.smooth or step.solver != NEWTON or len(heavy) == len(step.active):
            return step
        part = self.problem[heavy]
        enough = float(self.criterion.cost(step.M)) * (1 + LIGHT_LOSS * self.gap)
        weights = step.weights[np.isin(step.active, heavy)]
        weights = weights / weights.sum()
        M = part.information(weights)
        if not is_clearly_regular(M):
            return step
        if not self.criterion.cost(M) <= enough:
            try:
                weights, _ = self._by_newton(heavy, weights, EXACT)
            except RelaxationError:
                return step
            M = part.information(weights)
            if not self.criterion.cost(M) <= enough:
                return step
        return replace(step, active=heavy, weights=weights, M=M)

    def _prove(self, M: Array, Z: Array | None) -> tuple[Proof, Array]:
        """Find what a solver's multiplier Z (p, p) proves near the design M (p, p).

        Returns:
            The best proof, and the sensitivities (n,) of all candidates to its multiplier.
        """
        trials = self._trial_multipliers(M, Z)
        sensitivities = self.problem.sensitivities(trials)
        largest = sensitivities.max(axis=-1)
        found = [
            self.criterion.lower_bound(trials[i : i + 1], largest[i : i + 1], M)
            for i in range(len(trials))
        ]
        # A solver's multiplier may be so far off that its bound is negative or not a number.
        bounds = np.where(np.isfinite(found), np.maximum(found, 0.0), 0.0)
        best = int(np.argmax(bounds))
        proof = Proof(trials[best], float(largest[best]), float(bounds[best]))
        return proof, sensitivities[best]

    def _trial_multipliers(self, M: Array, Z: Array | None) -> Array:
        """Multipliers to try (r, p, p): the solver's, and minus the gradient at M of a smooth cost.

        A multiplier of a monotone criterion must be positive semidefinite. Its negative
        eigenvalues, which the solver's inaccuracy leaves, are cut off in the parameters that whiten
        M, where they are small beside the others.
        """
        if Z is None:
            return -self.criterion.gradient(M)[None]
        if self.criterion.monotone:
            T = whitener(M)
            S = np.linalg.inv(T)
            z, V = np.linalg.eigh(S @ Z @ S.T)
            Z = T @ (V * np.maximum(z, 0.0)) @ V.T @ T.T
        if not self.criterion.smooth:
            return Z[None]
        return np.stack([Z, -self.criterion.gradient(M)])
