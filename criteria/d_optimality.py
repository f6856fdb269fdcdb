"""D-optimality: the volume of the parameters' confidence ellipsoid."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.convex_criterion import ConvexCriterion
from criteria.criterion import DeterminantCriterion
from criteria.curvature import Curvature
from criteria.linalg.typing import Array
from criteria.registry import register

if TYPE_CHECKING:
    import cvxpy as cp


@register
class DOptimality(DeterminantCriterion, ConvexCriterion):
    """``det(M)^(1/p)``: the p-th root of what Table 1 prints, so that its degree is one.

    With cost ``f = det(M)^(-1/p)`` the gradient is ``-(f/p) cov``.
    """

    name = "D"
    title = "D-optimality"
    formula = "det(M)^(1/p)"
    sense = "max"
    degree = 1.0
    batched_curvature = True
    has_logarithm = True
    unit_free = True

    def cost_of_log_determinant(self, log_det: Array, p: int) -> Array:
        """``exp(-log det(M) / p)``; a determinant itself could overflow."""
        return np.asarray(np.exp(-log_det / p))

    def polar(self, Z: Array, M: Array) -> float:
        """``p det(Z)^(1/p)``, attained at ``Z^-1 / p``."""
        sign, log_det = np.linalg.slogdet(Z)
        return float(len(Z) * np.exp(log_det / len(Z))) if sign > 0 else 0.0

    def polar_of_root(self, B: Array, W: Array) -> float:
        """``p |det B|^(2/p)``."""
        return float(len(B) * np.exp(2 * np.linalg.slogdet(B).logabsdet / len(B)))

    def expression(self, M: "cp.Expression", T: Array | None = None) -> "cp.Expression":
        """``exp(-log det(T^-T M T^-1) / p)``."""
        import cvxpy as cp

        # T enters as a constant: log det(T^-T M T^-1) = log det M - 2 log |det T|.
        units = 0.0 if T is None else 2 * np.linalg.slogdet(T).logabsdet
        return cp.exp((units - cp.log_det(M)) / M.shape[0])

    def log_information(
        self, M: "cp.Expression", T: Array, unit: float
    ) -> tuple["cp.Expression", list["cp.Constraint"]]:
        """``log det(T^-T M T^-1) / p + log unit``."""
        import cvxpy as cp

        units = 2 * np.linalg.slogdet(T).logabsdet
        return (cp.log_det(M) - units) / M.shape[0] + np.log(unit), []

    def curvature(self, R: Array) -> Curvature:
        """``trace(cov dM cov dM) / p``, the second derivative of ``-log det(M) / p``."""
        p = R.shape[-1]
        each = np.full(R.shape, 1.0 / p)
        return Curvature(np.eye(p), each[..., 0], each, 0.0)

    def _gradient(self, M: Array, cov: Array) -> Array:
        return -self._cost(M, cov)[..., None, None] / M.shape[-1] * cov
