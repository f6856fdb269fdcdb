"""G-optimality, as the paper prints it."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.criterion import Array, Criterion
from criteria.linalg.inverse import power_trace, whitener
from criteria.linalg.soft_maximum import conjugate, soft_maximum
from criteria.registry import register

if TYPE_CHECKING:
    import cvxpy as cp

STEPS = 20  # towards the best weights of the variances


@register
class GOptimality(Criterion):
    """Largest variance of a parameter, ``max diag(cov)``; Table 1's "diag(k)" is read as diag(cov(k)).

    This is the paper's G; elsewhere G means the largest variance of a prediction over the candidates.
    Subgradient: ``-c c'`` for the column c of cov that holds the largest diagonal entry.

    Args:
        sharpness: Exponent of the soft maximum for max diag(cov); inf for the maximum itself.
    """

    name = "G"
    title = "G-optimality"
    formula = "max diag(cov)"
    sense = "min"
    degree = 1.0
    smooth = False

    def __init__(self, sharpness: float = np.inf) -> None:
        self.sharpness, self.smooth = sharpness, bool(np.isfinite(sharpness))

    def _cost(self, M: Array, cov: Array) -> Array:
        return soft_maximum(np.diagonal(cov, axis1=-2, axis2=-1), self.sharpness)[0]

    def _gradient(self, M: Array, cov: Array) -> Array:
        _, u = soft_maximum(np.diagonal(cov, axis1=-2, axis2=-1), self.sharpness)
        return -conjugate(cov, u)

    def polar(self, Z: Array, M: Array) -> float:
        """``(trace K^(1/2))^2`` with ``K = U^(1/2) Z U^(1/2)`` and U = diag(u), valid for any weights u of sum one.

        The largest variance is at least any weighted mean of them, whose polar is that of a weighted
        A-criterion. At the optimum ``Z = cov U cov``, hence the first choice ``u ~ diag(M Z M)``; the steps
        ``u ~ diag(K^(1/2))`` never make it worse. Next to it stands all weight on the largest variance.
        """
        T = whitener(M)
        S = np.linalg.inv(
            T
        )  # M = S'S and cov = T T': parameters of whatever units lose nothing in rounding
        variance = np.square(T).sum(axis=1)
        u = np.einsum("ai,ab,bi->i", S, S @ Z @ S.T, S)
        u = np.where(u * variance > 1e-8 * (u * variance).max(), u, 0.0)
        worst = (np.arange(len(u)) == variance.argmax()).astype(float)
        found = [0.0]
        for weights in (u, worst):
            for _ in range(STEPS if weights.any() else 0):
                root = np.sqrt(weights / weights.sum())
                K = root[:, None] * Z * root
                found.append(power_trace(K, 0.5) ** 2)
                values, V = np.linalg.eigh(K)
                weights = np.square(V) @ np.sqrt(np.maximum(values, 0.0))
        return max(found)

    def expression(self, M: "cp.Expression", T: Array | None = None) -> "cp.Expression":
        """``max_j t_j M^-1 t_j'`` over the rows t_j of T."""
        import cvxpy as cp

        rows = np.eye(M.shape[0]) if T is None else T
        return cp.max(cp.hstack([cp.matrix_frac(t, M) for t in rows]))

    def smoothed(self, sharpness: float) -> "GOptimality":
        """``(sum cov_ii^s)^(1/s)`` in place of the largest variance."""
        return GOptimality(sharpness)
