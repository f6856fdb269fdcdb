"""A-optimality: the mean variance of the parameters, up to their number."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.convex_criterion import ConvexCriterion
from criteria.criterion import CovarianceCriterion
from criteria.curvature import Curvature, curvature_of_variances
from criteria.linalg.inverse import power_trace, power_trace_of_root
from criteria.linalg.logarithms import log_of_inverse
from criteria.linalg.typing import Array
from criteria.registry import register

if TYPE_CHECKING:
    import cvxpy as cp


@register
class AOptimality(CovarianceCriterion, ConvexCriterion):
    """Sum of the parameters' variances, ``trace(cov)`` (Table 1). Gradient: ``-cov^2``."""

    name = "A"
    title = "A-optimality"
    formula = "trace(cov)"
    sense = "min"
    degree = 1.0
    batched_curvature = True
    has_logarithm = True

    def polar(self, Z: Array, M: Array) -> float:
        """``(trace Z^(1/2))^2``, attained at a multiple of ``Z^(-1/2)``."""
        return power_trace(Z, 0.5) ** 2

    def polar_of_root(self, B: Array, W: Array) -> float:
        """The square of the sum of the singular values of B."""
        return power_trace_of_root(B, 0.5) ** 2

    def expression(self, M: "cp.Expression", T: Array | None = None) -> "cp.Expression":
        """``trace(T M^-1 T')`` as a matrix-fractional function."""
        import cvxpy as cp

        return cp.matrix_frac(np.eye(M.shape[0]) if T is None else T.T, M)

    def log_information(
        self, M: "cp.Expression", T: Array, unit: float
    ) -> tuple["cp.Expression", list["cp.Constraint"]]:
        """``-log(trace(T M^-1 T') / unit)``."""
        return log_of_inverse(M, T, unit)

    def curvature(self, R: Array) -> Curvature:
        """That of ``log trace(R R')``."""
        return curvature_of_variances(R)

    def covariance_slope(self, cov: Array) -> Array:
        """The identity."""
        return np.broadcast_to(np.eye(cov.shape[-1]), cov.shape)

    def _cost(self, M: Array, cov: Array) -> Array:
        return np.trace(cov, axis1=-2, axis2=-1)

    def _gradient(self, M: Array, cov: Array) -> Array:
        return -cov @ cov
