"""What a relaxation solves instead of the problem as it was given, and the way back."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from criteria import Relaxable
from edtk.design.bound import BoundKind
from edtk.design.problem import Problem
from edtk.design.relaxation.inner_proof import InnerProof
from edtk.design.relaxation.relative_accuracy import relative_accuracy
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
    """

    problem: Problem
    criterion: Relaxable
    given: Relaxable
    whitened: Whitened | None
    of_squares: bool = False

    @classmethod
    def of(cls, problem: Problem, criterion: Relaxable) -> "Setting":
        """Transform a problem that would lose digits, with a criterion that can follow."""
        whitened = Whitened.of(problem)
        transformed = None if whitened is None else criterion.transformed(whitened.T)
        if whitened is None or not isinstance(transformed, Relaxable):
            return cls(problem, criterion, criterion, None)
        of_squares = not isinstance(problem.kept, Rows)
        return cls(whitened.problem, transformed, criterion, whitened, of_squares)

    def inward(self, multipliers: Array | None) -> Array | None:
        """Multipliers (r, p, p) of the parameters as given as those of the problem here."""
        if multipliers is None or self.whitened is None:
            return multipliers
        S = np.linalg.inv(self.whitened.T)
        return np.asarray(S @ multipliers @ S.T)

    def outward(self, found: "Relaxation") -> "Relaxation":
        """The result as one of the problem as it was given, with its accuracy."""
        rounding = None if self.whitened is None else self.whitened.rounding
        accuracy = relative_accuracy(
            self.problem,
            self.criterion,
            found.weights,
            found.multipliers,
            rounding,
            self.of_squares,
        )
        M = self.problem.information(found.weights)
        believes = self.criterion.rests_on_solver(found.multipliers, M)
        found = replace(found, accuracy=accuracy, rests_on_solver=believes)
        if believes:
            bound = replace(found.proved_bound, kind=BoundKind.SOLVED)
            found = replace(found, proved_bound=bound)
        if self.whitened is None:
            return found
        inner = InnerProof(self.whitened.T, found.multipliers)
        return replace(found, criterion=self.given, multipliers=inner.outward(), inner=inner)
