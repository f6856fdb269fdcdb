"""rho0, the paper's criterion: accuracy of the compliance compensation in the test pose."""

from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from criteria.convex_criterion import ConvexCriterion
from criteria.curvature import Curvature, curvature_of_variances
from criteria.linalg.inverse import lowered_root, power_trace_of_root, rounding_of_rows
from criteria.linalg.logarithms import log_of_inverse
from criteria.linalg.long_product import long_product
from criteria.linalg.typing import Array
from criteria.registry import register

if TYPE_CHECKING:
    import cvxpy as cp

FEW_PARAMETERS = 12  # parameters, up to which the target's rows one by one take a microsecond


@register
class CompensationAccuracy(ConvexCriterion):
    """``rho0 = sqrt(trace(A0 cov A0'))`` [m], the paper's Eq. (20).

    The root mean square distance between the desired and the compensated position in the test pose
    whose regressor is the target A0. Gradient: ``-cov A0' A0 cov / (2 rho0)``.

    Args:
        target: A0 of shape (rows, p) [m/(rad/(N m))], finite and not all zero.

    Raises:
        ValueError: The target is not such a matrix.
    """

    name = "rho0"
    title = "Test-pose accuracy"
    formula = "sqrt(trace(A0 cov A0'))"
    sense = "min"
    degree = 0.5
    batched_curvature = True
    has_logarithm = True
    unit_free = True
    needs_target = True
    shown = (1e3, "mm")
    expression_power = 2.0

    def __init__(self, target: ArrayLike) -> None:
        # A frozen copy: a later change of the caller's array must not change the criterion.
        self.target = np.array(target, dtype=float)
        if self.target.ndim != 2 or not np.isfinite(self.target).all() or not self.target.any():
            raise ValueError("rho0: the target A0 must be a finite, non-zero matrix (rows, p)")
        self.target.flags.writeable = False
        self._square = self.target.T @ self.target

    @property
    def arguments(self) -> dict[str, Any]:
        """The target."""
        return {"target": self.target.tolist()}

    @property
    def order(self) -> int:
        """Number of columns of the target."""
        return int(self.target.shape[1])

    def in_units(self, T: Array) -> Self:
        """The target becomes ``A0 T``."""
        return type(self)(long_product(self.target, T).astype(float))

    def transformed(self, T: Array) -> Self:
        """The same target says the same of other parameters."""
        return self.in_units(T)

    def rounding(self, W: Array) -> float:
        """That of the target's rows together."""
        return float(rounding_of_rows(self.target, W))

    def polar(self, Z: Array, M: Array) -> float:
        """``trace (A0 Z A0')^(1/2)``, as of a weighted A-criterion."""
        return power_trace_of_root(self.target @ lowered_root(Z).T, 0.5)

    def expression(self, M: "cp.Expression", T: Array | None = None) -> "cp.Expression":
        """``rho0^2 = trace(A0 T M^-1 T' A0')`` as a matrix-fractional function."""
        import cvxpy as cp

        return cp.matrix_frac(self.target.T if T is None else (self.target @ T).T, M)

    def log_information(
        self, M: "cp.Expression", T: Array, unit: float
    ) -> tuple["cp.Expression", list["cp.Constraint"]]:
        """``-log(rho0^2 / unit^2)``."""
        return log_of_inverse(M, self.target @ T, unit**2)

    def curvature(self, R: Array) -> Curvature:
        """Half of that of ``log trace(A0 cov A0')``."""
        return curvature_of_variances(self.target @ R).power(self.degree)

    def _cost(self, M: Array, cov: Array) -> Array:
        if self.order > FEW_PARAMETERS:
            # ``trace(A0 cov A0') = <A0'A0, cov>``: a hundredth of the work where p and r are forty.
            return np.sqrt(np.einsum("ij,...ij->...", self._square, cov))
        return np.sqrt(np.einsum("ri,...ij,rj->...", self.target, cov, self.target))

    def _gradient(self, M: Array, cov: Array) -> Array:
        B = self.target @ cov
        return -0.5 / self._cost(M, cov)[..., None, None] * np.swapaxes(B, -1, -2) @ B
