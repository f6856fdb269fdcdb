"""O3, the least singular value."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.criterion import Array, Criterion, Formulation
from criteria.linalg.soft_maximum import conjugate, soft_maximum
from criteria.linalg.spectrum import bounded_below
from criteria.registry import register

if TYPE_CHECKING:
    import cvxpy as cp


@register
class MinimumSingularValue(Criterion):
    """``s_p = sqrt(lambda_min(M))``, s the singular values of the stacked A/sigma.

    Table 1 prints "min"; it is read as the field does, to be maximised. The cost is ``lambda_max(cov)^(1/2)``
    with subgradient ``-cost^3/2 v v'``.

    Args:
        sharpness: Exponent of the soft maximum for lambda_max(cov); inf for the maximum itself.
    """

    name = "O3"
    title = "Minimum singular value"
    formula = "s_p"
    sense = "max"
    degree = 0.5
    expression_power = 2.0
    smooth = False

    def __init__(self, sharpness: float = np.inf) -> None:
        self.sharpness, self.smooth = sharpness, bool(np.isfinite(sharpness))

    def _cost(self, M: Array, cov: Array) -> Array:
        return np.sqrt(soft_maximum(np.linalg.eigvalsh(cov), self.sharpness)[0])

    def _gradient(self, M: Array, cov: Array) -> Array:
        c, V = np.linalg.eigh(cov)
        top, u = soft_maximum(c, self.sharpness)
        return -0.5 * conjugate(V, u * c**2) / np.sqrt(top)[..., None, None]

    def polar(self, Z: Array, M: Array) -> float:
        """``trace(Z)^(1/2)``, since ``lambda_min(X) trace(Z) <= <Z, X>``."""
        return float(np.sqrt(np.trace(Z)))

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """Homogenised: the least sum of weights u with ``sum u_i M_i >= I``, which is ``s_p^-2``."""
        return total, [bounded_below(M, T)]

    def smoothed(self, sharpness: float) -> "MinimumSingularValue":
        """``trace(cov^s)^(1/2s)`` in place of lambda_max(cov)^(1/2)."""
        return MinimumSingularValue(sharpness)
