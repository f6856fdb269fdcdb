"""Criteria of combinations of the parameters that have names of their own: I, c and Ds."""

from typing import TYPE_CHECKING

from criteria.criterion import Criterion
from criteria.interest import Interest
from criteria.linalg.log_of_inverse import log_of_inverse
from criteria.linalg.typing import Array
from criteria.relaxable import Formulation, Relaxable

if TYPE_CHECKING:
    import cvxpy as cp


class NamedInterest(Interest):
    """An `Interest` whose class declares its name and all that an Interest takes from its base.

    The parameters' units do not matter: the combinations change with them, and their variances stay
    as they are.
    """

    needs_parameters = True
    unit_free = True
    expression_power = 1.0

    def _describe(self, base: Relaxable) -> None:
        """Its class says it all."""

    def require_order(self, p: int) -> None:
        """As every criterion: what is of interest is its own matter, and not that of `interest`."""
        Criterion.require_order(self, p)


class SumOfVariances(NamedInterest):
    """``trace(K' cov K)``, the sum of the variances of the combinations; the base of I and of c."""

    sense = "min"
    degree = 1.0

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """``trace(K'T M^-1 T'K) / unit`` as a matrix-fractional function.

        It needs no variable for C_K, and allows a singular M whose range holds K.
        """
        import cvxpy as cp

        return cp.matrix_frac(T.T @ self.K * unit**-0.5, M), [total == 1]

    def log_information(
        self, M: "cp.Expression", T: Array, unit: float
    ) -> tuple["cp.Expression", list["cp.Constraint"]]:
        """``-log(trace(K'T M^-1 T'K) / unit)``."""
        return log_of_inverse(M, self.K.T @ T, unit)
