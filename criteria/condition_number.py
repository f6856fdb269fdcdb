"""O2: the condition number of the stacked regressor."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.criterion import KinkedCriterion
from criteria.linalg.inverse import eigenpairs
from criteria.linalg.logarithms import soft_maximum
from criteria.linalg.spectrum import bounded_below, conjugate, definite_parts, largest_eigenvalue
from criteria.linalg.typing import Array
from criteria.registry import register
from criteria.relaxable import Formulation, Relaxable, SpectralBand

if TYPE_CHECKING:
    import cvxpy as cp


@register
class ConditionNumber(KinkedCriterion, Relaxable):
    """``s_1/s_p = sqrt(lambda_max(M) lambda_max(cov))`` (Table 1), s singular values of A/sigma.

    It does not see the amount of information (degree 0). It is neither convex (only quasiconvex)
    nor monotone: a further experiment can make it worse. With unit eigenvectors v of the extreme
    eigenvalues the gradient is ``cost/2 (v_1 v_1'/lambda_1 - v_p v_p'/lambda_p)``.
    """

    name = "O2"
    title = "Condition number"
    formula = "s_1 / s_p"
    sense = "min"
    degree = 0.0
    expression_power = 2.0
    convex = False
    of_spectrum = True
    monotone = False

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """``min kappa`` over ``I <= sum u_i M_i <= kappa I``, where the sum of u is free."""
        return largest_eigenvalue(M, T), [bounded_below(M, T)]

    def spectral_band(self, p: int) -> SpectralBand | None:
        """``min kappa`` over ``I <= M(w) <= kappa I``, unless it is smoothed."""
        return None if self.smooth else SpectralBand.of(1.0, 0.0, p)

    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """``kappa >= trace(Y+)/trace(Y-)`` for ``Y = Z - t I``, since ``<Y, X> <= 0``.

        Designs have unit trace, so that ``<Z, X> <= t`` is ``<Y, X> <= 0``. Of all X with
        ``I <= X <= kappa I`` the least ``<Y, X>`` is ``trace(Y+) - kappa trace(Y-)``.
        """
        above, below = definite_parts(Z - t[:, None, None] * np.eye(Z.shape[-1]))
        # A Y without negative part would exclude every design; from rounding, it proves nothing.
        ratio = np.divide(above, below, out=np.ones_like(above), where=below > 0)
        return float(np.sqrt(max(1.0, ratio.max())))

    def _cost(self, M: Array, cov: Array) -> Array:
        high, _ = soft_maximum(np.linalg.eigvalsh(M), self.sharpness)
        low, _ = soft_maximum(np.linalg.eigvalsh(cov), self.sharpness)
        return np.sqrt(high * low)

    def _gradient(self, M: Array, cov: Array) -> Array:
        eigenvalues, V = eigenpairs(M)
        variances, U = eigenpairs(cov)
        high, high_slopes = soft_maximum(eigenvalues, self.sharpness)
        low, low_slopes = soft_maximum(variances, self.sharpness)
        of_high = conjugate(V, high_slopes / high[..., None])
        of_low = conjugate(U, low_slopes * variances**2 / low[..., None])
        return 0.5 * np.sqrt(high * low)[..., None, None] * (of_high - of_low)
