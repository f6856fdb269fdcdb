"""O2, the condition number."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.criterion import Array, Criterion, Formulation
from criteria.linalg.soft_maximum import conjugate, soft_maximum
from criteria.linalg.spectrum import bounded_below, largest, parts
from criteria.registry import register

if TYPE_CHECKING:
    import cvxpy as cp


@register
class ConditionNumber(Criterion):
    """``s_1 / s_p = sqrt(lambda_max(M) lambda_max(cov))`` (Table 1), s the singular values of the stacked A/sigma.

    Blind to the amount of information (degree 0), neither convex (only quasiconvex) nor monotone: a further
    experiment can make it worse. With unit eigenvectors v of the extreme eigenvalues the gradient is
    ``cost/2 (v_1 v_1'/lambda_1 - v_p v_p'/lambda_p)``.

    Args:
        sharpness: Exponent of the soft maximum for the largest eigenvalues of M and cov; inf for the maximum itself.
    """

    name = "O2"
    title = "Condition number"
    formula = "s_1 / s_p"
    sense = "min"
    degree = 0.0
    expression_power = 2.0
    convex = False
    smooth = False
    monotone = False

    def __init__(self, sharpness: float = np.inf) -> None:
        self.sharpness, self.smooth = sharpness, bool(np.isfinite(sharpness))

    def _cost(self, M: Array, cov: Array) -> Array:
        high, low = (soft_maximum(np.linalg.eigvalsh(X), self.sharpness)[0] for X in (M, cov))
        return np.sqrt(high * low)

    def _gradient(self, M: Array, cov: Array) -> Array:
        m, V = np.linalg.eigh(M)
        c, U = np.linalg.eigh(cov)
        (high, v), (low, u) = soft_maximum(m, self.sharpness), soft_maximum(c, self.sharpness)
        G = conjugate(V, v / high[..., None]) - conjugate(U, u * c**2 / low[..., None])
        return 0.5 * np.sqrt(high * low)[..., None, None] * G

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """Homogenised: ``min kappa`` over ``I <= sum u_i M_i <= kappa I``, where the sum of u is free."""
        return largest(M, T), [bounded_below(M, T)]

    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """Designs of unit trace obey ``<Z - t I, X> <= 0``, so that ``kappa >= trace(Y+)/trace(Y-)``, Y = Z - t I.

        Of all X with ``I <= X <= kappa I`` the least ``<Y, X>`` is ``trace(Y+) - kappa trace(Y-)``.
        """
        above, below = parts(Z - t[:, None, None] * np.eye(Z.shape[-1]))
        ratio = np.divide(above, below, out=np.ones_like(above), where=below > 0)
        return float(np.sqrt(max(1.0, ratio.max())))

    def smoothed(self, sharpness: float) -> "ConditionNumber":
        """Soft maxima of the eigenvalues of M and of cov in place of the largest ones."""
        return ConditionNumber(sharpness)
