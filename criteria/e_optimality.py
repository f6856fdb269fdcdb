"""E-optimality."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.criterion import Array, Criterion, Formulation
from criteria.linalg.soft_maximum import conjugate, soft_maximum
from criteria.linalg.spectrum import bounded_below
from criteria.registry import register

if TYPE_CHECKING:
    import cvxpy as cp


@register
class EOptimality(Criterion):
    """Least eigenvalue of the information matrix, ``lambda_min(M)`` (Table 1).

    The cost is ``lambda_max(cov)``, with subgradient ``-cost^2 v v'`` for its unit eigenvector v.

    Args:
        sharpness: Exponent of the soft maximum for lambda_max(cov); inf for the maximum itself.
    """

    name = "E"
    title = "E-optimality"
    formula = "lambda_min(M)"
    sense = "max"
    degree = 1.0
    smooth = False

    def __init__(self, sharpness: float = np.inf) -> None:
        self.sharpness, self.smooth = sharpness, bool(np.isfinite(sharpness))

    def _cost(self, M: Array, cov: Array) -> Array:
        return soft_maximum(np.linalg.eigvalsh(cov), self.sharpness)[0]

    def _gradient(self, M: Array, cov: Array) -> Array:
        c, V = np.linalg.eigh(cov)
        return -conjugate(V, soft_maximum(c, self.sharpness)[1] * c**2)

    def polar(self, Z: Array, M: Array) -> float:
        """``trace(Z)``, since ``lambda_min(X) trace(Z) <= <Z, X>``."""
        return float(np.trace(Z))

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """Homogenised: the least sum of weights u with ``sum u_i M_i >= I``, which is ``1/lambda_min``."""
        return total, [bounded_below(M, T)]

    def smoothed(self, sharpness: float) -> "EOptimality":
        """``trace(cov^s)^(1/s)`` in place of lambda_max(cov)."""
        return EOptimality(sharpness)
