"""O5: the sum of the inverse singular values of the stacked regressor."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.convex_criterion import ConvexCriterion
from criteria.criterion import CovarianceCriterion
from criteria.curvature import Curvature, curvature_of_spectrum
from criteria.linalg.inverse import eigenpairs, power_trace, power_trace_of_root
from criteria.linalg.spectrum import conjugate, sharp_variances
from criteria.linalg.typing import Array
from criteria.registry import register
from criteria.relaxable import Formulation

if TYPE_CHECKING:
    import cvxpy as cp


@register
class InverseSingularValueSum(CovarianceCriterion, ConvexCriterion):
    """``sum 1/s_i = trace M^(-1/2)`` (Table 1), s the singular values of A/sigma.

    Convex, since t^(-1/2) is operator convex. Gradient: ``-1/2 M^(-3/2)``.
    """

    name = "O5"
    title = "Sum of inverse singular values"
    formula = "sum 1/s_i"
    sense = "min"
    degree = 0.5
    batched_curvature = True

    def polar(self, Z: Array, M: Array) -> float:
        """``(trace Z^(1/3))^(3/2)``, attained at a multiple of ``Z^(-2/3)``."""
        return power_trace(Z, 1 / 3) ** 1.5

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """``min trace R^-1`` over ``R^2 <= M`` in the original units, whose best R is M^(1/2).

        With ``T = U diag(s) Q`` that is ``diag(s) R^2 diag(s) <= Q M Q'``, R turned by U. R is
        measured in p/unit, the size of a root of M, and enters as ``E^-1 R E^-1`` with
        ``E = diag(s/s_1)^(1/2)``. So no constant of ``[[Q M Q', B], [B', E^2]] >= 0``,
        ``B = s_1 p/unit E R``, is far above one.
        """
        import cvxpy as cp

        p = len(T)
        R = cp.Variable((p, p), symmetric=True)
        _, s, Q = np.linalg.svd(T)
        e = np.sqrt(s / s[0])
        turned = Q @ M @ Q.T
        B = s[0] * p / unit * cp.multiply(np.repeat(e[:, None], p, 1), R)
        # cvxpy cannot tell that Q M Q' is symmetric, and asks for it.
        square = cp.bmat([[0.5 * (turned + turned.T), B], [B.T, np.diag(e**2)]])
        return cp.matrix_frac(np.diag(e), R) / p, [square >> 0, total == 1]

    def curvature(self, R: Array) -> Curvature:
        """That of ``log trace(cov^(1/2))``."""
        return curvature_of_spectrum(R, 0.5)

    def covariance_slope(self, cov: Array) -> Array:
        """``cov^(-1/2) / 2``."""
        variances, V = eigenpairs(cov)
        positive = np.maximum(variances, np.finfo(float).tiny)
        return 0.5 * conjugate(V, positive**-0.5)

    def polar_of_root(self, B: Array, W: Array) -> float:
        """``(sum s_i^(2/3))^(3/2)`` of the singular values s of B."""
        return power_trace_of_root(B, 1 / 3) ** 1.5

    def cost_of_root(self, L: Array) -> Array:
        """The sum of the singular values of L, which have the digits that eigenvalues lose."""
        return np.asarray(np.linalg.svd(L, compute_uv=False).sum(axis=-1))

    def slope_of_root(self, L: Array) -> Array:
        """``(L'L)^(1/2) / 2``."""
        _, s, rows = np.linalg.svd(L)
        return 0.5 * conjugate(np.swapaxes(rows, -1, -2), s)

    def _cost(self, M: Array, cov: Array) -> Array:
        return np.sqrt(sharp_variances(cov)).sum(axis=-1)

    def _gradient(self, M: Array, cov: Array) -> Array:
        variances, V = eigenpairs(cov)
        return -0.5 * conjugate(V, np.maximum(variances, 0.0) ** 1.5)
