"""Bayesian criteria, A and D: what is known before the experiments counts beside what they tell."""

from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from criteria.a_optimality import AOptimality
from criteria.criterion import Criterion
from criteria.d_optimality import DOptimality
from criteria.errors import CriterionError
from criteria.linalg.inverse import full_rank_root
from criteria.linalg.typing import Array, Mask
from criteria.registry import register
from criteria.relaxable import Formulation, Relaxable

if TYPE_CHECKING:
    import cvxpy as cp


class BayesianCriterion(Relaxable):
    """``phi(M + R)``: a criterion of the posterior's precision, with the prior precision R.

    In a linear model with a normal prior of precision R, in the units of M, the posterior has the
    precision M + R whatever is observed (Chaloner and Verdinelli 1995). So a design may be singular
    where the prior is not. The cost is homogeneous together with R only,
    ``cost_cR(c M) = c^-degree cost_R(M)``: a plan of m experiments, each of information
    ``M/m``, is judged like a single one with the precision ``R/m``, see `for_size`.

    **Dual bound.** ``<Z, X> <= t`` is ``<Z, X + R> <= t + <Z, R>``, which bounds ``phi(X + R)`` as
    it does every other matrix.

    Args:
        precision: R (p, p), symmetric, positive semidefinite and not zero.

    Attributes:
        base_class: The class of phi.

    Raises:
        CriterionError: The precision is not such a matrix.
    """

    base_class: ClassVar[type[Relaxable]]
    needs_parameters = True
    takes_interest = False
    needs_all = False

    def __init__(self, precision: ArrayLike) -> None:
        try:
            full_rank_root(precision)
        except ValueError as error:
            raise CriterionError(f"criterion {self.name!r}: precision: {error}") from error
        self.precision = np.array(precision, dtype=float)
        self.precision.flags.writeable = False
        self.base = self.base_class()
        self.smooth = self.base.smooth
        self.expression_power = self.base.expression_power

    @property
    def arguments(self) -> dict[str, Any]:
        """The prior precision."""
        assert self.precision is not None
        return {"precision": self.precision.tolist()}

    @property
    def order(self) -> int:
        """That of the precision."""
        return len(self._R)

    @property
    def without_prior(self) -> Criterion:
        """The criterion phi of M + R."""
        return self.base

    def for_size(self, size: float) -> Self:
        """The criterion of one of `size` experiments that share the prior: with ``R/size``."""
        return type(self)(self._R / size)

    def smoothed(self, sharpness: float) -> Self:
        """With the smoothed phi."""
        return self._with(self.base.smoothed(sharpness), self._R)

    def in_units(self, T: Array) -> Self:
        """The precision becomes ``T' R T``."""
        return self._with(self.base.in_units(T), T.T @ self._R @ T)

    def inverse(self, M: Array) -> tuple[Array, Array, Mask]:
        """M, and the inverse of M + R."""
        safe, cov, regular = self.base.inverse(M + self._R)
        return np.where(regular[..., None, None], M, safe), cov, regular

    def whitener(self, M: Array) -> Array:
        """That of M + R."""
        return self.base.whitener(M + self._R)

    def missing(self, M: Array, parameters: tuple[str, ...]) -> tuple[str, ...]:
        """What neither M nor the prior tells."""
        return self.base.missing(M + self._R, parameters)

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """The program of phi, for designs that the prior adds to."""
        return self.base.formulation(M + T.T @ self._R @ T, total, T, unit)

    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """That of phi for ``t + <Z, R>`` near M + R."""
        more = np.einsum("rij,ij->r", Z, self._R)
        return self.base.lower_bound(Z, t + more, M + self._R)

    @property
    def _R(self) -> Array:
        assert self.precision is not None
        return self.precision

    def _with(self, base: Relaxable, precision: Array) -> Self:
        """Another phi, or another precision."""
        other = type(self)(precision)
        other.base = base
        other.smooth = base.smooth
        return other

    def _cost(self, M: Array, cov: Array) -> Array:
        return self.base.cost_of_regular(M + self._R, cov)

    def _gradient(self, M: Array, cov: Array) -> Array:
        return self.base.gradient_of_regular(M + self._R, cov)


@register
class BayesianAOptimality(BayesianCriterion):
    """``trace((M + R)^-1)`` for a prior precision R, see `BayesianCriterion`."""

    name = "bayes_A"
    title = "Bayesian A-optimality"
    formula = "trace((M + R)^-1)"
    sense = "min"
    degree = 1.0
    base_class = AOptimality


@register
class BayesianDOptimality(BayesianCriterion):
    """``det(M + R)^(1/p)`` for a prior precision R, see `BayesianCriterion`."""

    name = "bayes_D"
    title = "Bayesian D-optimality"
    formula = "det(M + R)^(1/p)"
    sense = "max"
    degree = 1.0
    unit_free = True
    base_class = DOptimality
