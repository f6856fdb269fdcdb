"""What a relaxation solves instead of the problem as it was given, and the way back."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from criteria import Relaxable
from criteria.interest import DEPENDENT
from edtk.design.bound import BLURRED, Bound, BoundKind
from edtk.design.problem import Problem
from edtk.design.relaxation.inner_proof import InnerProof
from edtk.design.relaxation.relative_accuracy import EPS, errors
from edtk.design.rows import Rows
from edtk.design.whitened import Whitened
from edtk.system.typing import Array

if TYPE_CHECKING:
    from edtk.design.relaxation.relaxation import Relaxation


@dataclass(frozen=True, eq=False)
class Setting:
    """A problem with the same weights, and a criterion with the same costs.

    Attributes:
        problem: The candidates, in parameters that they tell equally well where it matters.
        criterion: The criterion as a function of the information about these.
        given: The criterion as it was given.
        whitened: How the problem was transformed; None where it is as it was given.
        of_squares: Whether information was transformed, for want of rows.
        prior: Prior information (p, p) of the problem as it was given.
    """

    problem: Problem
    criterion: Relaxable
    given: Relaxable
    whitened: Whitened | None
    of_squares: bool = False
    prior: Array | None = None

    @classmethod
    def of(cls, problem: Problem, criterion: Relaxable) -> "Setting":
        """Transform a problem that would lose digits, with a criterion that can follow."""
        depends = criterion.dependence(problem.conditioning.scale) > DEPENDENT
        whitened = Whitened.of(problem, needed=depends)
        found = None if whitened is None else cls.by(problem, criterion, whitened)
        return found or cls(problem, criterion, criterion, None)

    @classmethod
    def by(cls, problem: Problem, criterion: Relaxable, whitened: Whitened) -> "Setting | None":
        """The transformed problem; None for a criterion that cannot follow."""
        transformed = criterion.transformed(whitened.T)
        if not isinstance(transformed, Relaxable):
            return None
        of_squares = not isinstance(problem.kept, Rows)
        return cls(whitened.problem, transformed, criterion, whitened, of_squares, problem.prior)

    def _lost_by_transforming(self, M: Array) -> float:
        """Relative error, of a variance, of what is given beside the candidates: squares and rows.

        A prior R is known to ``p eps (R_ii R_jj)^(1/2)``, as the design that it is a part of.
        """
        if self.whitened is None:
            return 0.0
        W = self.whitened.T @ self.criterion.whitener(M)
        found = self.given.rounding(W)
        if self.prior is not None:
            own = np.linalg.norm(np.sqrt(np.diag(self.prior))[:, None] * W, 2)
            found += float(len(W) ** 2 * EPS * own**2)
        return found

    def errors(self, weights: Array | None, multipliers: Array) -> tuple[float, float]:
        """Relative errors that rounding may have made in the cost of weights, and in a bound.

        Args:
            weights: Weights (n,); None for equal ones.
            multipliers: Multipliers (r, p, p) of the problem here.
        """
        rounding = None if self.whitened is None else self.whitened.rounding
        of_cost, of_bound = errors(
            self.problem, self.criterion, weights, multipliers, rounding, self.of_squares
        )
        M = self.problem.mean if weights is None else self.problem.information(weights)
        of_given = self._lost_by_transforming(M)
        of_given *= self.criterion.degree if self.criterion.monotone else 1 + self.criterion.degree
        return of_cost + of_given, of_bound + of_given

    def inward(self, multipliers: Array | None) -> Array | None:
        """Multipliers (r, p, p) of the parameters as given as those of the problem here."""
        if multipliers is None or self.whitened is None:
            return multipliers
        S = np.linalg.inv(self.whitened.T)
        return np.asarray(S @ multipliers @ S.T)

    def outward(self, found: "Relaxation") -> "Relaxation":
        """The result as one of the problem as it was given, with its accuracy."""
        of_cost, of_bound = self.errors(found.weights, found.multipliers)
        M = self.problem.information(found.weights)
        believes = self.criterion.rests_on_solver(found.multipliers, M)
        bound = Bound.of(
            self.given,
            found.proved_bound.cost,
            found.cost,
            BoundKind.SOLVED if believes else found.proved_bound.kind,
            of_bound,
            max(of_cost, BLURRED),
        )
        found = replace(
            found,
            accuracy=of_cost + of_bound,
            rests_on_solver=believes,
            proved_bound=bound,
        )
        if self.whitened is None:
            return found
        inner = InnerProof(self.whitened.T, found.multipliers)
        return replace(found, criterion=self.given, multipliers=inner.outward(), inner=inner)
