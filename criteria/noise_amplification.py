"""O4: the noise amplification index."""

from typing import TYPE_CHECKING

import numpy as np

from criteria.criterion import KinkedCriterion
from criteria.linalg.inverse import eigenpairs
from criteria.linalg.logarithms import soft_maximum
from criteria.linalg.spectrum import conjugate
from criteria.linalg.typing import Array
from criteria.registry import register
from criteria.relaxable import Formulation, Relaxable
from criteria.spectral_balance import SpectralBalance, corners

if TYPE_CHECKING:
    import cvxpy as cp


@register
class NoiseAmplification(KinkedCriterion, Relaxable):
    """``s_p^2 / s_1`` (Table 1), s the singular values of A/sigma.

    Neither convex nor monotone: information in the strongest direction lowers it. The cost is
    ``f = sqrt(lambda_1) / lambda_p`` with gradient
    ``f (v_1 v_1'/(2 lambda_1) - v_p v_p'/lambda_p)``.

    It is optimised over a family of convex problems. Let ``s = 1/lambda_p`` and
    ``kappa = lambda_1/lambda_p``; then ``f^2 = s kappa``, and the points (s, kappa) that designs
    reach or exceed form a convex set. A problem ``min a kappa + b s`` (`SpectralBalance`) gives a
    supporting line of that set. The lines leave a polygon, and over it the product s kappa takes
    its least value in a corner. So the least corner bounds every design, not only those of the
    family. The next line cuts that corner off.
    """

    name = "O4"
    title = "Noise amplification index"
    formula = "s_p^2 / s_1"
    sense = "max"
    degree = 0.5
    convex = False
    of_spectrum = True
    monotone = False
    most_subproblems = 60  # a handful of lines is the rule; the limit only ends bad cases

    def subproblem(self, Z: Array, t: Array, M: Array) -> Relaxable:
        """The member of the family that cuts off the least corner; the design M sets the first."""
        if len(Z):
            s, kappa = _least_corner(Z, t)
        else:
            # In uneven units the least eigenvalue of M is a rounding of the largest; that of its
            # inverse is a largest one.
            _, cov, _ = self.inverse(M)
            s = np.linalg.eigvalsh(cov)[-1]
            kappa = np.linalg.eigvalsh(M)[-1] * s
        if s == 0:  # no line bounds s yet: the one of E-optimality does
            return SpectralBalance(0.0, 1.0)
        return SpectralBalance(1.0 / kappa, 1.0 / s)

    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """``sqrt(s kappa)`` at the least corner of the polygon that the multipliers prove."""
        return float(np.sqrt(np.prod(_least_corner(Z, t))))

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """O4 has no program of its own.

        Raises:
            NotImplementedError: Always; the members that `subproblem` names have programs.
        """
        raise NotImplementedError(f"criterion {self.name} has no program but those of its family")

    def _cost(self, M: Array, cov: Array) -> Array:
        high, _ = soft_maximum(np.linalg.eigvalsh(M), self.sharpness)
        low, _ = soft_maximum(np.linalg.eigvalsh(cov), self.sharpness)
        return np.sqrt(high) * low

    def _gradient(self, M: Array, cov: Array) -> Array:
        eigenvalues, V = eigenpairs(M)
        variances, U = eigenpairs(cov)
        high, high_slopes = soft_maximum(eigenvalues, self.sharpness)
        low, low_slopes = soft_maximum(variances, self.sharpness)
        of_high = conjugate(V, 0.5 * high_slopes / high[..., None])
        of_low = conjugate(U, low_slopes * variances**2 / low[..., None])
        return (np.sqrt(high) * low)[..., None, None] * (of_high - of_low)


def _least_corner(Z: Array, t: Array) -> Array:
    """The corner (2,) with the least product s kappa."""
    found = corners(Z, t)
    return np.asarray(found[found.prod(axis=1).argmin()])
