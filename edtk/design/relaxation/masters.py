"""Restricted master problems, each solved by the method that suits it."""

from dataclasses import dataclass, replace

import numpy as np

from criteria import Relaxable
from edtk.design.problem import Problem
from edtk.design.relaxation.loss_weights import loss_weights
from edtk.design.relaxation.master_equations import ActiveInformation
from edtk.design.relaxation.newton_weights import NewtonError, newton_weights, suits_newton
from edtk.design.relaxation.proof import Step, WarmStart, experiment_blocks
from edtk.design.relaxation.restricted_master import (
    FINEST,
    NEWTON,
    Effort,
    RelaxationError,
    is_clearly_regular,
    regular_weights,
    restricted_master_for,
)
from edtk.design.relaxation.spectral_weights import spectral_weights
from edtk.design.relaxation.variance_weights import variance_weights
from edtk.system.typing import Array

# Accuracy of Newton's method for a criterion with kinks, in parts of the gap that is asked for.
EXACT_GAP = 0.01
HEAVY = 1e-4  # weight, in parts of the largest, of candidates that a design shall rest on
LIGHT_LOSS = 0.05  # part of the gap that it may lose by leaving the others
DROPPED_SHARE = 1e-3  # share of light weights that are dropped then, likewise


def has_own_method(criterion: Relaxable, p: int) -> bool:
    """Whether a criterion of p parameters needs no program of cvxpy's."""
    forms = (criterion.spectral_band(p), criterion.variance_rows(p), criterion.largest_of(p))
    return suits_newton(criterion, p) or any(form is not None for form in forms)


def own_weights(
    criterion: Relaxable,
    active: ActiveInformation,
    start: Array,
    accuracy: float,
    near: Array | None = None,
) -> tuple[Array, Array | None]:
    """Find the best weights of a few candidates.

    Args:
        criterion: What is minimised.
        active: Information of the candidates (k).
        start: Weights (k,) to start from; those of zero are new.
        accuracy: Relative gap at which to end.
        near: The multiplier (p, p) that the weights to start from had, if it is known.

    Returns:
        Weights (k,), positive, of sum one, and a multiplier (p, p); None where minus the gradient
        is one.

    Raises:
        NewtonError: The criterion has no suitable form, or the method has broken down.
        LinAlgError: A matrix is singular.
    """
    p = len(active.information(start))
    band = criterion.spectral_band(p)
    if band is not None:
        return spectral_weights(band, active, start, accuracy, near)
    rows = criterion.variance_rows(p)
    if rows is not None:
        return variance_weights(rows, active, start, accuracy, near)
    losses = criterion.largest_of(p)
    if losses is not None:
        return loss_weights(losses, active, start, accuracy)
    if not suits_newton(criterion, p):
        raise NewtonError(f"criterion {criterion.name} is not smooth")
    weights = newton_weights(criterion, active, start, accuracy)
    if criterion.needs_all:
        return weights, None
    # Where a design without light candidates is singular, its gradient need not be a multiplier.
    return weights, np.asarray(-criterion.gradient(active.information(weights)))


@dataclass(frozen=True, eq=False)
class Masters:
    """The relaxation over any few of the candidates.

    Attributes:
        problem: The candidates, see `normalised`.
        criterion: What is minimised, with a convex form of its own.
        gap: Relative gap between cost and bound that is asked for.
        batch: Candidates that enter per round.
    """

    problem: Problem
    criterion: Relaxable
    gap: float
    batch: int

    def solve(self, start: WarmStart, effort: Effort) -> tuple[Array, Array | None, str]:
        """Find the best weights of some candidates.

        Args:
            start: The candidates (k), with weights to start near.
            effort: Accuracy and solvers.

        Returns:
            Weights (k,), their multiplier (p, p), and the solver. Without a multiplier minus the
            gradient is one.

        Raises:
            RelaxationError: All solvers failed; the message has the words of each.
        """
        solvers = effort.solvers
        failure = ""
        if solvers[0] == NEWTON:
            try:
                return *self._by_newton(start, effort.accuracy), NEWTON
            except RelaxationError as error:
                if len(solvers) == 1:
                    raise
                failure = str(error)
                solvers = solvers[1:]
        blocks = experiment_blocks(self.problem, start.candidates)
        around = self._around(blocks, start.weights)
        size = max(2 * self.batch, len(start))
        program = restricted_master_for(self.criterion, around, size)
        try:
            return program.solve_by_first(blocks, solvers, effort.loose)
        except RelaxationError as error:
            raise RelaxationError(f"{failure}; {error}" if failure else str(error)) from error

    def _around(self, blocks: Array, weights: Array) -> Array:
        """The design (p, p) that a program is whitened by: near its optimum, and regular."""
        entering = weights == 0
        around = np.tensordot(weights, blocks, axes=1)
        if entering.any():
            around = 0.5 * (around + blocks[entering].mean(axis=0))
        if not is_clearly_regular(around):
            around = 0.5 * (around + self.problem.mean)
        return np.asarray(around)

    def _by_newton(self, start: WarmStart, accuracy: float) -> tuple[Array, Array | None]:
        """Weights (k,), and a multiplier where minus the gradient is none."""
        try:
            information = ActiveInformation.of(self.problem, start.candidates)
            if not self.criterion.smooth:
                accuracy = max(accuracy, EXACT_GAP * self.gap)
            found, Z = own_weights(
                self.criterion, information, start.weights, accuracy, start.multiplier
            )
        except (np.linalg.LinAlgError, ValueError, ArithmeticError) as error:
            raise RelaxationError(f"{NEWTON}: {' '.join(str(error).split())}") from error
        # Where a cost has kinks, many light weights together are worth more than each of them.
        lost = None if self.criterion.smooth else DROPPED_SHARE * self.gap
        weights = regular_weights(self.criterion, information, found, NEWTON, lost)
        if Z is None and accuracy <= FINEST and (weights == 0).any():
            # Without its light candidates a design may prove less than the gap that is asked for.
            Z = np.asarray(-self.criterion.gradient(information.information(found)))
        return weights, Z

    def on_heavy(self, step: Step) -> Step:
        """A design on the candidates of much weight alone, if it is as good.

        Where a cost has kinks, an interior point leaves weights of the size of its accuracy on many
        candidates, which the others must take over.
        """
        heavy = step.active[step.weights > HEAVY * step.weights.max()]
        if self.criterion.smooth or step.solver != NEWTON or len(heavy) == len(step.active):
            return step
        part = self.problem[heavy]
        enough = step.cost * (1 + LIGHT_LOSS * self.gap)
        weights = step.weights[np.isin(step.active, heavy)]
        weights = weights / weights.sum()
        M = part.information(weights)
        if not is_clearly_regular(M):
            return step
        cost = float(self.criterion.cost(M))
        if not cost <= enough:
            try:
                weights, _ = self._by_newton(
                    WarmStart(heavy, weights, step.last.multiplier), FINEST
                )
            except RelaxationError:
                return step
            M = part.information(weights)
            cost = float(self.criterion.cost(M))
            if not cost <= enough:
                return step
        # A bound is told again near the design that is given; it must not be lost by the change.
        Z = step.proof.multiplier[None]
        bound = self.criterion.lower_bound(Z, np.array([step.proof.largest]), M)
        if not bound >= step.proof.lower_bound * (1 - LIGHT_LOSS * self.gap):
            return step
        return replace(step, active=heavy, weights=weights, M=M, cost=cost)
