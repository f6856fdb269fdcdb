"""Problems whose information is far from one, in units in which no square leaves doubles."""

from dataclasses import dataclass, replace

import numpy as np

from criteria import Criterion
from edtk.design.packed_information import PackedInformation
from edtk.design.problem import Problem
from edtk.design.relaxation.relaxation import Relaxation
from edtk.design.rows import Rows
from edtk.system.errors import UserError
from edtk.system.typing import Array

# Sizes of the mean information between which nothing is changed: its fourth power is a double.
SMALL = 1e-60
LARGE = 1e60


@dataclass(frozen=True, eq=False)
class OrderOne:
    """The same candidates in another unit of measurement, with ``2^power`` times the rows.

    All criteria are homogeneous, ``cost(c M) = c^-degree cost(M)``, so that weights and multipliers
    are those of the candidates as given, and costs differ by a number alone. Methods of relaxations
    take squares of information, and of covariances, which leave doubles at 1e155 and at 1e-162.

    Attributes:
        problem: The candidates, with information of order one.
        power: Power of two of the rows; zero where nothing is changed.
    """

    problem: Problem
    power: int

    @classmethod
    def of(cls, problem: Problem) -> "OrderOne":
        """Change the unit where the size of the information asks for it."""
        with np.errstate(over="ignore"):
            size = float(np.trace(problem.mean))
        if SMALL < size < LARGE:
            return cls(problem, 0)
        largest = _largest_row(problem)
        # Powers of two change no digit.
        power = -int(np.frexp(largest)[1]) if largest > 0 else 0
        return cls(_times(problem, power) if power else problem, power)

    def information(self, M: Array) -> Array:
        """The information (p, p) here, of one for the candidates as given."""
        return np.asarray(np.ldexp(M, 2 * self.power)) if self.power else M

    def cost(self, cost: float, criterion: Criterion) -> float:
        """The cost for the candidates as given, of a cost here.

        Raises:
            UserError: It is no number that a double holds.
        """
        if not self.power or not np.isfinite(cost) or cost == 0:
            return cost
        exponent = 2 * self.power * criterion.degree
        whole = int(np.floor(exponent))
        with np.errstate(over="ignore", under="ignore"):
            found = float(np.ldexp(cost * 2.0 ** (exponent - whole), whole))
        if not np.finfo(float).tiny <= found < np.inf:
            decades = np.log10(cost) + exponent * np.log10(2.0)
            raise UserError(
                f"criterion {criterion.label!r}: a cost of 1e{decades:+.0f} is beyond "
                "floating-point numbers; expected regressors in other units"
            )
        return found

    def outward(self, found: Relaxation) -> Relaxation:
        """The result for the candidates as given."""
        if not self.power:
            return found
        criterion = found.criterion
        bound = found.proved_bound
        return replace(
            found,
            cost=self.cost(found.cost, criterion),
            proved_bound=replace(bound, cost=self.cost(bound.cost, criterion)),
        )


def _largest_row(problem: Problem) -> float:
    """The largest entry of a row; of information, the root of the largest on a diagonal."""
    if isinstance(problem.kept, Rows):
        own = float(np.abs(problem.kept.A).max())
    else:
        own = float(np.sqrt(problem.kept.largest().max()))
    if problem.prior is None:
        return own
    return max(own, float(np.sqrt(np.diag(problem.prior).max())))


def _times(problem: Problem, power: int) -> Problem:
    """The candidates with ``2^power`` times the rows."""
    kept: Rows | PackedInformation
    if isinstance(problem.kept, Rows):
        kept = Rows(np.ldexp(problem.kept.A, power))
    else:
        kept = PackedInformation(np.ldexp(problem.kept.triangles, 2 * power))
    prior = None if problem.prior is None else np.ldexp(problem.prior, 2 * power)
    found = Problem.of_kept(kept, problem.parameters, prior)
    found.is_exact = problem.is_exact
    return found
