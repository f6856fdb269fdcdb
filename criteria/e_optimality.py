"""E-optimality."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.criterion import Array, Criterion
from criteria.registry import register

if TYPE_CHECKING:
    import cvxpy as cp


@register
class EOptimality(Criterion):
    """Least eigenvalue of the information matrix, ``lambda_min(M)`` (Table 1).

    The cost is ``lambda_max(cov)``, with subgradient ``-cost^2 v v'`` for its unit eigenvector v.
    """

    name = "E"
    title = "E-optimality"
    formula = "lambda_min(M)"
    sense = "max"
    degree = 1.0
    smooth = False

    def _cost(self, M: Array, cov: Array) -> Array:
        return np.linalg.eigvalsh(cov).max(axis=-1)

    def _gradient(self, M: Array, cov: Array) -> Array:
        c, V = np.linalg.eigh(cov)
        v = V[..., -1]
        v = c[..., -1, None] * v  # scaled so that its outer product is the whole gradient
        return -v[..., :, None] * v[..., None, :]

    def polar(self, Z: Array, M: Array) -> float:
        """``trace(Z)``, since ``lambda_min(X) trace(Z) <= <Z, X>``."""
        return float(np.trace(Z))

    def expression(self, M: "cp.Expression", T: Array | None = None) -> "cp.Expression":
        """``1 / lambda_min(T^-T M T^-1)``."""
        import cvxpy as cp

        if T is not None:
            S = np.linalg.inv(T)
            M = S.T @ M @ S
            M = 0.5 * (M + M.T)
        return cp.inv_pos(cp.lambda_min(M))
