"""Column generation: one small convex program after another, over a few of the candidates each."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from criteria import Relaxable
from criteria.linalg.inverse import whitener
from edtk.design.problem import Problem
from edtk.design.relaxation.experiment_blocks import experiment_blocks
from edtk.design.relaxation.first_active_set import first_active_set
from edtk.design.relaxation.restricted_master import RelaxationError, restricted_master_for
from edtk.design.relaxation.solver_options import SolverOptions
from edtk.system.typing import Array, Indices

# While the gap is above this, a program is solved to a few digits: its multiplier is good enough
# to say which candidates should enter, and the solver takes fewer iterations.
FAR = 0.05
# Gap that a program solved to a few digits can still prove; a smaller one needs an exact solution.
COARSE = 1e-3
# Candidates per one that enters from which on the choice is spread over parts of the list.
SPREAD = 20


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
    """

    active: Indices
    weights: Array
    M: Array
    proof: Proof
    solver: str


@dataclass(frozen=True)
class _Effort:
    """How accurately the next program is solved, and by which solvers in turn."""

    solvers: tuple[str, ...]
    loose: bool

    def after(self, step: Step, inaccurate: bool, gap: float) -> "_Effort":
        """The effort for the next program: more where the last answer was too inaccurate."""
        failed = inaccurate and not self.loose
        left = self.solvers[self.solvers.index(step.solver) + 1 :] if failed else self.solvers
        return _Effort(left, self.loose and not inaccurate and gap > FAR)


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
        active = active if can_end else first_active_set(self.problem, self.options.batch)
        around = experiment_blocks(self.problem, active).mean(axis=0)
        # Where the first program holds all candidates, it decides nothing but the answer itself.
        loose = self.criterion.convex and len(active) < self.problem.n
        effort = _Effort(self.options.solvers, loose)
        step = None
        cost = np.inf
        for _ in range(self.options.rounds):
            try:
                step, sensitivities = self._step(active, around, effort, step)
            except RelaxationError:
                if can_end:
                    return
                raise
            yield step
            can_end = True
            cost = min(cost, float(self.criterion.cost(step.M)))
            gap = 1 - step.proof.lower_bound / cost
            if gap <= self.gap and (self.gap >= COARSE or not effort.loose):
                return
            # After an exact solution a candidate outside has the largest sensitivity, unless the
            # gap is closed: where an active one has it, the solver was not accurate enough.
            effort = effort.after(step, sensitivities.argmax() in active, gap)
            if not effort.solvers:
                return
            entering = entering_candidates(sensitivities, active, self.options.batch)
            active = np.concatenate([step.active, entering])
            around = self._around(step.M, entering)

    def _step(
        self, active: Indices, around: Array, effort: _Effort, before: Step | None
    ) -> tuple[Step, Array]:
        """Solve the program over the active candidates.

        Returns:
            The step, and the sensitivities (n,) of all candidates to the program's multiplier.
        """
        size = max(2 * self.options.batch, len(active))
        program = restricted_master_for(self.criterion, around, size)
        blocks = experiment_blocks(self.problem, active)
        weights, Z, solver = program.solve_by_first(blocks, effort.solvers, effort.loose)
        M = np.tensordot(weights, blocks, axes=1)
        proof, sensitivities = self._prove(M, Z)
        if before is not None and not proof.lower_bound > before.proof.lower_bound:
            proof = before.proof
        carries = weights > 0
        return Step(active[carries], weights[carries], M, proof, solver), sensitivities

    def _prove(self, M: Array, Z: Array) -> tuple[Proof, Array]:
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

    def _trial_multipliers(self, M: Array, Z: Array) -> Array:
        """Multipliers to try (r, p, p): the solver's, and minus the gradient at M of a smooth cost.

        A multiplier of a monotone criterion must be positive semidefinite. Its negative
        eigenvalues, which the solver's inaccuracy leaves, are cut off in the parameters that whiten
        M, where they are small beside the others.
        """
        if self.criterion.monotone:
            T = whitener(M)
            S = np.linalg.inv(T)
            z, V = np.linalg.eigh(S @ Z @ S.T)
            Z = T @ (V * np.maximum(z, 0.0)) @ V.T @ T.T
        if not self.criterion.smooth:
            return Z[None]
        return np.stack([Z, -self.criterion.gradient(M)])

    def _around(self, M: Array, entering: Indices) -> Array:
        """The design (p, p) that the next program is whitened by: near its optimum, and regular."""
        if not len(entering):
            return M
        return 0.5 * (M + experiment_blocks(self.problem, entering).mean(axis=0))


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
    largest = np.argpartition(-sensitivities, size - 1)[:size]
    chosen = _inactive_by_sensitivity(sensitivities, active, largest)
    parts = 3 * batch // 4
    if parts and n >= SPREAD * batch:
        width = n // parts
        in_parts = sensitivities[: width * parts].reshape(parts, width)
        spread = in_parts.argmax(axis=1) + width * np.arange(parts)
        both = np.union1d(chosen[: batch - parts], spread)
        chosen = _inactive_by_sensitivity(sensitivities, active, both)
    return chosen[:batch]


def _inactive_by_sensitivity(sensitivities: Array, active: Indices, chosen: Indices) -> Indices:
    """Those of chosen candidates that are not active, the largest sensitivity first."""
    inactive = np.setdiff1d(chosen, active)
    return inactive[np.argsort(-sensitivities[inactive], kind="stable")]
