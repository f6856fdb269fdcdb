"""E-optimality: the variance in the worst direction of the parameters."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.convex_criterion import ConvexCriterion
from criteria.criterion import CovarianceCriterion, KinkedCriterion
from criteria.linalg.inverse import eigenpairs
from criteria.linalg.logarithms import soft_maximum
from criteria.linalg.spectrum import bounded_below, conjugate
from criteria.linalg.typing import Array
from criteria.registry import register
from criteria.relaxable import Formulation, SpectralBand

if TYPE_CHECKING:
    import cvxpy as cp


@register
class EOptimality(KinkedCriterion, CovarianceCriterion, ConvexCriterion):
    """Least eigenvalue of the information matrix, ``lambda_min(M)`` (Table 1).

    The cost is ``lambda_max(cov)``, or ``trace(cov^s)^(1/s)`` with sharpness s. A subgradient is
    ``-cost^2 v v'`` for the unit eigenvector v.
    """

    name = "E"
    title = "E-optimality"
    formula = "lambda_min(M)"
    sense = "max"
    degree = 1.0

    def polar(self, Z: Array, M: Array) -> float:
        """``trace(Z)``, since ``lambda_min(X) trace(Z) <= <Z, X>``."""
        return float(np.trace(Z))

    def polars(self, Z: Array, M: Array) -> Array:
        """The traces, whatever M."""
        return np.asarray(np.trace(Z, axis1=1, axis2=2))

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """The least sum of weights u with ``sum u_i M_i >= I``, which is ``1/lambda_min``."""
        return total, [bounded_below(M, T)]

    def spectral_band(self, p: int) -> SpectralBand | None:
        """``min sum(w)`` over ``I <= M(w)``, unless it is smoothed."""
        return None if self.smooth else SpectralBand.of(0.0, 1.0, p)

    def covariance_slope(self, cov: Array) -> Array:
        """``v v'`` for the unit eigenvector of the largest variance, or a soft maximum's slopes."""
        variances, V = eigenpairs(cov)
        return conjugate(V, soft_maximum(variances, self.sharpness)[1])

    def _cost(self, M: Array, cov: Array) -> Array:
        return soft_maximum(np.linalg.eigvalsh(cov), self.sharpness)[0]

    def _gradient(self, M: Array, cov: Array) -> Array:
        variances, V = eigenpairs(cov)
        _, slopes = soft_maximum(variances, self.sharpness)
        return -conjugate(V, slopes * variances**2)
