"""O1, the geometric mean of the singular values."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.criterion import Array, Criterion
from criteria.registry import register

if TYPE_CHECKING:
    import cvxpy as cp


@register
class SingularValueProduct(Criterion):
    """``(s_1 ... s_p)^(1/p) = det(M)^(1/2p)`` (Table 1), s the singular values of the stacked A/sigma.

    With cost ``f = det(M)^(-1/2p)`` the gradient is ``-(f/2p) cov``.
    """

    name = "O1"
    title = "Product of singular values"
    formula = "(s_1 ... s_p)^(1/p)"
    sense = "max"
    degree = 0.5
    unit_free = True
    determinant_only = True

    def _cost(self, M: Array, cov: Array) -> Array:
        return self.cost_of_log_determinant(np.linalg.slogdet(M).logabsdet, M.shape[-1])

    def cost_of_log_determinant(self, log_det: Array, p: int) -> Array:
        """All that counts."""
        return np.asarray(np.exp(-log_det / (2 * p)))

    def _gradient(self, M: Array, cov: Array) -> Array:
        return -self._cost(M, cov)[..., None, None] / (2 * M.shape[-1]) * cov

    def polar(self, Z: Array, M: Array) -> float:
        """``(p det(Z)^(1/p))^(1/2)``, attained at ``Z^-1 / p``."""
        return float(np.sqrt(len(Z)) * np.exp(np.linalg.slogdet(Z).logabsdet / (2 * len(Z))))

    def expression(self, M: "cp.Expression", T: Array | None = None) -> "cp.Expression":
        """``exp(-log det(T^-T M T^-1) / 2p)``."""
        import cvxpy as cp

        units = 0.0 if T is None else 2 * np.linalg.slogdet(T).logabsdet
        return cp.exp((units - cp.log_det(M)) / (2 * M.shape[0]))
