"""G-optimality, as the paper prints it: the largest variance of a parameter."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.convex_criterion import ConvexCriterion
from criteria.criterion import CovarianceCriterion, KinkedCriterion
from criteria.linalg.inverse import lowered_root, power_trace_of_root, whitener
from criteria.linalg.logarithms import soft_maximum
from criteria.linalg.shares import WEIGHT_STEPS
from criteria.linalg.spectrum import conjugate
from criteria.linalg.typing import Array
from criteria.registry import register

if TYPE_CHECKING:
    import cvxpy as cp

NEGLIGIBLE = (
    1e-8  # a variance whose weighted part is below this share of the largest gets no weight
)


@register
class GOptimality(KinkedCriterion, CovarianceCriterion, ConvexCriterion):
    """Largest variance of a parameter, ``max diag(cov)``; Table 1's "diag(k)" means diag(cov(k)).

    This is the paper's G. Elsewhere G means the largest variance of a prediction over the
    candidates, which is "prediction_G" here. The cost is ``(sum cov_ii^s)^(1/s)`` with
    sharpness s. A subgradient is ``-c c'`` for the column c of cov that holds the largest diagonal
    entry.
    """

    name = "G"
    title = "G-optimality"
    formula = "max diag(cov)"
    sense = "min"
    degree = 1.0

    def polar(self, Z: Array, M: Array) -> float:
        """``(trace K^(1/2))^2``, ``K = U^(1/2) Z U^(1/2)``, U = diag(u), for weights u of sum one.

        Any u is valid: the largest variance is at least any weighted mean of the variances, whose
        polar is that of a weighted A-criterion. At the optimum ``Z = cov U cov``, hence the first
        choice ``u ~ diag(M Z M)``; the steps ``u ~ diag(K^(1/2))`` never make it worse. The second
        choice is all weight on the largest variance.
        """
        return self.polar_of_root(lowered_root(Z).T, whitener(M))

    def dual_weights(self, Z: Array, M: Array) -> Array:
        """The weights u (p,) of sum one that `polar` takes."""
        return self.dual_weights_of_root(lowered_root(Z).T, whitener(M))

    def polar_of_root(self, B: Array, W: Array) -> float:
        """The same, with singular values of ``U^(1/2) B`` in place of the roots of K."""
        return self._best_of_root(B, W)[0]

    def dual_weights_of_root(self, B: Array, W: Array) -> Array:
        """The weights that `polar_of_root` takes."""
        return self._best_of_root(B, W)[1]

    def _best_of_root(self, B: Array, W: Array) -> tuple[float, Array]:
        """The polar of ``Z = B B'`` near ``(W W')^-1``, and its weights."""
        variances = np.square(W).sum(axis=1)
        # M Z M = S'(S B)(S B)'S with M = S'S.
        S = np.linalg.inv(W)
        at_optimum = np.square(S.T @ (S @ B)).sum(axis=1)
        parts = at_optimum * variances
        at_optimum = np.where(parts > NEGLIGIBLE * parts.max(), at_optimum, 0.0)
        on_largest = (np.arange(len(parts)) == variances.argmax()).astype(float)
        found = [_best_weights(B, at_optimum), _best_weights(B, on_largest)]
        return max(found, key=lambda best: best[0])

    def expression(self, M: "cp.Expression", T: Array | None = None) -> "cp.Expression":
        """``max_j t_j M^-1 t_j'`` over the rows t_j of T."""
        import cvxpy as cp

        rows = np.eye(M.shape[0]) if T is None else T
        return cp.max(cp.hstack([cp.matrix_frac(t, M) for t in rows]))

    def variance_rows(self, p: int) -> Array | None:
        """Those of each parameter, unless it is smoothed."""
        return None if self.smooth else np.eye(p)[:, None, :]

    def covariance_slope(self, cov: Array) -> Array:
        """One at the largest diagonal entry, or the slopes of the soft maximum."""
        _, slopes = soft_maximum(np.diagonal(cov, axis1=-2, axis2=-1), self.sharpness)
        return slopes[..., None] * np.eye(cov.shape[-1])

    def _cost(self, M: Array, cov: Array) -> Array:
        return soft_maximum(np.diagonal(cov, axis1=-2, axis2=-1), self.sharpness)[0]

    def _gradient(self, M: Array, cov: Array) -> Array:
        _, slopes = soft_maximum(np.diagonal(cov, axis1=-2, axis2=-1), self.sharpness)
        return -conjugate(cov, slopes)


def _best_weights(B: Array, weights: Array) -> tuple[float, Array]:
    """The best of the polars of weighted A-criteria on the way from given weights, and its own."""
    best = 0.0
    best_weights = np.zeros_like(weights)
    # Each step is a fixed-point iteration of "weights are the diagonal of the root of K".
    for _ in range(WEIGHT_STEPS):
        if not weights.sum() > 0:
            break  # no weights, no proof
        weights = weights / weights.sum()
        scaled = np.sqrt(weights)[:, None] * B
        found = power_trace_of_root(scaled, 0.5) ** 2
        if found > best:
            best = found
            best_weights = weights
        if np.count_nonzero(weights) == 1:
            break  # all weight on one variance stays there
        U, s, _ = np.linalg.svd(scaled, full_matrices=False)
        weights = np.square(U) @ s
    return best, best_weights
