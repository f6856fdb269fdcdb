"""What a relaxation solves instead of the problem as it was given."""

from dataclasses import dataclass

import numpy as np

from criteria import Criterion, CriterionError, Relaxable
from criteria.interest import DEPENDENT
from criteria.linalg.estimable import open_subspace, range_whitener
from criteria.linalg.inverse import EPS, root
from criteria.plugins import require_homogeneous
from edtk.design.information import Known, Rows
from edtk.design.problem import Problem
from edtk.design.problems import Whitened
from edtk.design.relaxation.proof import errors
from edtk.system.errors import UserError
from edtk.system.typing import Array

# Sizes of a parameter's information between which nothing is changed: its fourth power is a double.
SMALLEST_OF_PARAMETER = 1e-60
LARGEST_OF_PARAMETER = 1e60
# Squares of information and of covariances together span four times the decades of the units.
WIDEST_SPAN = 1e150


@dataclass(frozen=True, eq=False)
class OrderOne:
    """The same candidates in another unit of measurement, with ``2^power`` times the rows.

    All criteria are homogeneous, ``cost(c M) = c^-degree cost(M)``, so that weights and multipliers
    are those of the candidates as given, and costs differ by a number alone. Methods of relaxations
    take squares of information, and of covariances, which leave doubles at 1e155 and at 1e-162. So
    the largest column is as far above one as the smallest is below it.

    Attributes:
        problem: The candidates, with information of order one.
        power: Power of two of the rows; zero where nothing is changed.
    """

    problem: Problem
    power: int

    @classmethod
    def of(cls, problem: Problem) -> "OrderOne":
        """Change the unit where the size of the information asks for it.

        Raises:
            UserError: Parameters that were given have units too far apart for doubles.
        """
        with np.errstate(over="ignore"):
            own = np.diag(problem.mean)
        if own.min() > SMALLEST_OF_PARAMETER and own.max() < LARGEST_OF_PARAMETER:
            return cls(problem, 0)
        least, largest = _extreme_columns(problem)
        if least > SMALLEST_OF_PARAMETER**0.5 and largest < LARGEST_OF_PARAMETER**0.5:
            return cls(problem, 0)
        # Powers of two change no digit.
        power = -int(np.frexp(np.sqrt(least) * np.sqrt(largest))[1])
        return cls(problem.in_unit(power) if power else problem, power)

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


def _extreme_columns(problem: Problem) -> tuple[float, float]:
    """The sizes of the smallest and of the largest column that is not zero; one without any.

    Raises:
        UserError: They are so far apart that squares of information are no doubles.
    """
    sizes = problem.kept.sizes()
    if problem.prior is not None:
        sizes = np.maximum(sizes, np.sqrt(np.diag(problem.prior)))
    told = np.flatnonzero(sizes)
    if not len(told):
        return 1.0, 1.0
    if not problem.is_exact:
        # What a model has computed is rounding where it is so small.
        told = told[sizes[told] > sizes.max() / WIDEST_SPAN]
    least, largest = (told[int(find(sizes[told]))] for find in (np.argmin, np.argmax))
    decades = float(np.log10(sizes[largest]) - np.log10(sizes[least]))
    if decades > np.log10(WIDEST_SPAN):
        few, many = (problem.parameters[i] for i in (least, largest))
        raise UserError(
            f"regressors of {many} and {few} are {decades:.0f} decades apart, and squares of their "
            f"information no floating-point numbers; expected units at most "
            f"{np.log10(WIDEST_SPAN):.0f} decades apart"
        )
    return float(sizes[least]), float(sizes[largest])


def without_open_directions(problem: Problem) -> Problem:
    """The same problem with information about the directions that all its candidates leave open.

    Let ``M U = 0`` for every design M, let W be such that W'U is regular, and let ``U'K = 0``, so
    that K'k is estimable. From ``(M + W W') Y = K`` follow ``U'W W'Y = 0``, so ``W'Y = 0`` and
    ``M Y = K``: C_K is the same with and without W W'. With it, all designs can be regular.

    Args:
        problem: Candidates that tell all that is of interest.

    Returns:
        A problem whose prior has W W' besides; the problem itself where no direction is open.
    """
    W = problem.models.diagonal([open_subspace(one.mean)[1] for one in problem.each])
    if not W.size:
        return problem
    prior = W @ W.T if problem.prior is None else problem.prior + W @ W.T
    return problem.with_prior(prior)


def opened(problem: Problem, multipliers: Array) -> Array:
    """``P Z P'`` (r, p, p) of the multipliers of a closed problem, see `Relaxation.opened`."""
    found_open = [open_subspace(one.mean) for one in problem.each]
    U = problem.models.diagonal([left for left, _ in found_open])
    W = problem.models.diagonal([closing for _, closing in found_open])
    P = np.eye(problem.p) - U @ W.T
    # A product of a root with itself is semidefinite, where P Z P' may leave a noise that is not.
    roots = np.array([root(z) @ P.T for z in multipliers])
    return np.asarray(np.swapaxes(roots, 1, 2) @ roots)


@dataclass(frozen=True, eq=False)
class Setting:
    """A problem with the same weights, and a criterion with the same costs.

    Attributes:
        problem: The candidates, in parameters that they tell equally well where it matters.
        criterion: The criterion as a function of the information about these.
        given: The criterion as it was given.
        whitened: How the problem was transformed; None where it is as it was given.
        of_squares: Whether information was transformed, for want of rows.
        known: The prior of the problem as it was given.
    """

    problem: Problem
    criterion: Relaxable
    given: Relaxable
    whitened: Whitened | None
    of_squares: bool = False
    known: Known | None = None

    @classmethod
    def of(cls, problem: Problem, criterion: Relaxable, as_rows: bool = False) -> "Setting":
        """Transform a problem that would lose digits, with a criterion that can follow.

        Args:
            problem: The candidates, and a prior.
            criterion: What is minimised.
            as_rows: Whether rows are to stay rows, however many they are.
        """
        depends = criterion.dependence(problem.conditioning.scale) > DEPENDENT
        whitened = Whitened.of(problem, needed=depends, as_rows=as_rows)
        found = None if whitened is None else cls.by(problem, criterion, whitened)
        return found or cls(problem, criterion, criterion, None)

    @classmethod
    def by(cls, problem: Problem, criterion: Relaxable, whitened: Whitened) -> "Setting | None":
        """The transformed problem; None for a criterion that cannot follow."""
        transformed = criterion.transformed(whitened.T)
        if not isinstance(transformed, Relaxable):
            return None
        of_squares = not isinstance(problem.kept, Rows)
        return cls(whitened.problem, transformed, criterion, whitened, of_squares, problem.known)

    def _lost_by_transforming(self, M: Array) -> float:
        """Relative error, of a variance, of what is given beside the candidates."""
        if self.whitened is None:
            return 0.0
        W = self.criterion.whitener(M)
        found = self.given.rounding(self.whitened.T @ W)
        if self.known is not None:
            found += self.known.rounding(self.whitened.T, W)
        return found

    def _lost_by_combining(self, F: Array) -> float:
        """Relative error of ``K' F F' K`` where a matrix ``F F'`` (p, p) is multiplied as it is.

        `Criterion.rounding` is ``2 p eps r``, where r is how far terms of a combination ``K'F``
        exceed their sum. A matrix that is multiplied from both sides has r twice: ``2 p eps r^2``.
        """
        each = 2 * len(F) * EPS
        return float(each * (self.criterion.rounding(F) / each) ** 2)

    def errors(
        self, weights: Array | None, multipliers: Array, design: Array | None = None
    ) -> tuple[float, float]:
        """Relative errors that rounding may have made in the cost of weights, and in a bound.

        A cost combines the covariance, ``K' cov K``, and a bound a multiplier, ``K' Z K``. Of a
        design that is all but singular the first cancels, and the second need not. What weighs
        little in Z does not count: there the error of the cost is the smaller estimate.

        Args:
            weights: Weights (n,); None for equal ones.
            multipliers: Multipliers (r, p, p) of the problem here.
            design: The design (p, p) of the weights where it is less than their sum, see `errors`.
        """
        rounding = None if self.whitened is None else self.whitened.rounding
        of_cost, of_bound = errors(
            self.problem, self.criterion, weights, multipliers, rounding, self.of_squares, design
        )
        M = self.problem.mean if weights is None else self.problem.information(weights)
        M = M if design is None else design
        given = self._lost_by_transforming(M)
        by_cov = self._lost_by_combining(range_whitener(M))
        if not self.criterion.monotone:
            lost = (1 + self.criterion.degree) * (given + by_cov)
            return of_cost + lost, of_bound + lost
        by_Z = by_cov
        if by_cov and len(multipliers):
            by_Z = min(by_cov, max(self._lost_by_combining(root(Z).T) for Z in multipliers))
        degree = self.criterion.degree
        return of_cost + degree * (given + by_cov), of_bound + degree * (given + by_Z)

    def inward(self, multipliers: Array | None) -> Array | None:
        """Multipliers (r, p, p) of the parameters as given as those of the problem here."""
        if multipliers is None or self.whitened is None:
            return multipliers
        S = np.linalg.inv(self.whitened.T)
        return np.asarray(S @ multipliers @ S.T)


def solvable(problem: Problem, criterion: Relaxable) -> tuple[Setting, Problem]:
    """The setting in which a relaxation is solved, and its problem with no direction left open.

    Args:
        problem: Candidates whose information is of order one, see `OrderOne`.
        criterion: A criterion without a Bayesian prior.

    Raises:
        RankDeficientError: The candidates do not tell what the criterion needs.
        CriterionError: The criterion is not homogeneous.
    """
    problem.require_identifiable(criterion)
    setting = Setting.of(problem, criterion)
    mean = setting.problem.mean
    try:
        require_homogeneous(setting.criterion, mean)
    except CriterionError:
        # What rounding makes of costs takes longer to tell than most costs need.
        of_cost, _ = setting.errors(None, np.empty((0, problem.p, problem.p)))
        require_homogeneous(setting.criterion, mean, of_cost)
    closed = setting.problem
    return setting, closed if criterion.needs_all else without_open_directions(closed)
