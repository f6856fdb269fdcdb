"""O3, the least singular value."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.criterion import Array, Criterion
from criteria.registry import register

if TYPE_CHECKING:
    import cvxpy as cp


@register
class MinimumSingularValue(Criterion):
    """``s_p = sqrt(lambda_min(M))``, s the singular values of the stacked A/sigma.

    Table 1 prints "min"; it is read as the field does, to be maximised. The cost is ``lambda_max(cov)^(1/2)``
    with subgradient ``-cost^3/2 v v'``.
    """

    name = "O3"
    title = "Minimum singular value"
    formula = "s_p"
    sense = "max"
    degree = 0.5
    smooth = False

    def _cost(self, M: Array, cov: Array) -> Array:
        return np.sqrt(np.linalg.eigvalsh(cov)[..., -1])

    def _gradient(self, M: Array, cov: Array) -> Array:
        c, V = np.linalg.eigh(cov)
        v = V[..., -1]
        return -0.5 * c[..., -1, None, None] ** 1.5 * v[..., :, None] * v[..., None, :]

    def polar(self, Z: Array, M: Array) -> float:
        """``trace(Z)^(1/2)``, since ``lambda_min(X) trace(Z) <= <Z, X>``."""
        return float(np.sqrt(np.trace(Z)))

    def expression(self, M: "cp.Expression", T: Array | None = None) -> "cp.Expression":
        """``lambda_min(T^-T M T^-1)^(-1/2)``."""
        import cvxpy as cp

        if T is not None:
            S = np.linalg.inv(T)
            M = S.T @ M @ S
            M = 0.5 * (M + M.T)
        return cp.power(cp.lambda_min(M), -0.5)
