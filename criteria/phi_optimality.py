"""Kiefer's family phi_q, which leads from D (q = 0) over A (q = 1) towards E (q to infinity)."""

from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from criteria.a_optimality import AOptimality
from criteria.convex_criterion import ConvexCriterion
from criteria.criterion import CovarianceCriterion, Criterion
from criteria.curvature import Curvature, curvature_of_spectrum
from criteria.d_optimality import DOptimality
from criteria.errors import CriterionError
from criteria.linalg.inverse import eigenpairs, guarded_inverse, power_trace, power_trace_of_root
from criteria.linalg.spectrum import conjugate, sharp_variances
from criteria.linalg.typing import Array
from criteria.registry import register
from criteria.relaxable import Formulation, TransformedByFactor

if TYPE_CHECKING:
    import cvxpy as cp

MOST = 50.0  # beyond it powers of eigenvalues leave the range of doubles, and E is as good


@register
class PhiOptimality(CovarianceCriterion, ConvexCriterion):
    """``(trace(cov^q) / p)^(1/q)``, the mean of order q of the eigenvalues of cov (Kiefer 1974).

    For q = 0 it is the geometric mean ``det(cov)^(1/p)``. With eigenvalues v of cov and the cost f
    the gradient is ``-V diag(v^2 (v/f)^(q-1)) V' / p``.

    Args:
        q: Order of the mean, from 0 to 50.

    Raises:
        CriterionError: q is not such a number.
    """

    name = "phi"
    title = "Kiefer's phi_q"
    formula = "(trace(cov^q) / p)^(1/q)"
    sense = "min"
    degree = 1.0
    batched_curvature = True
    needs_parameters = True
    has_logarithm = True

    def __init__(self, q: float) -> None:
        if not _is_number(q) or not 0 <= q <= MOST:
            raise CriterionError(
                f"criterion 'phi': expected q from 0 (D) over 1 (A) to {MOST:g}, not {q!r}; for "
                "infinity, use E"
            )
        self.q = float(q)
        self.title = f"Kiefer's phi_q (q = {self.q:g})"
        self.unit_free = self.q == 0

    @property
    def label(self) -> str:
        """Such as "phi (q = 2)"."""
        return f"{self.name} (q = {self.q:g})"

    @property
    def arguments(self) -> dict[str, Any]:
        """The order q."""
        return {"q": self.q}

    def polar(self, Z: Array, M: Array) -> float:
        """``p (trace(Z^s)/p)^(1/s)``, ``s = q/(q+1)``, attained at a multiple of ``Z^(s-1)``.

        It is Hoelder's inequality for traces; for q = 0 it is ``p det(Z)^(1/p)``.
        """
        p = len(Z)
        if self.q == 0:
            return DOptimality().polar(Z, M)
        s = self.q / (self.q + 1)
        return float(p * (power_trace(Z, s) / p) ** (1 / s))

    def polar_of_root(self, B: Array, W: Array) -> float:
        """The same of the squared singular values of B."""
        p = len(B)
        if self.q == 0:
            return DOptimality().polar_of_root(B, W)
        s = self.q / (self.q + 1)
        return float(p * (power_trace_of_root(B, s) / p) ** (1 / s))

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """The mean of order -q of l, which the eigenvalues of ``X = T^-T M T^-1`` majorise.

        A convex function that falls with each eigenvalue and does not know their order is least, of
        all l with ``l_1 + .. + l_k <= sum of the k least eigenvalues of X``, at the eigenvalues
        themselves (Ben-Tal and Nemirovski, Lectures on Modern Convex Optimization, 4.2).
        """
        import cvxpy as cp

        p = len(T)
        if self.q == 0:
            return DOptimality().formulation(M, total, T, unit)
        if self.q == 1:
            return AOptimality().formulation(M, total, T, unit * p)
        least, constraints = self._least_eigenvalues(M, T, unit)
        mean = cp.inv_pos(cp.pnorm(least, -self.q)) * p ** (-1 / self.q)
        return mean, [*constraints, total == 1]

    def log_information(
        self, M: "cp.Expression", T: Array, unit: float
    ) -> tuple["cp.Expression", list["cp.Constraint"]]:
        """The log of the mean of order -q of the same numbers."""
        import cvxpy as cp

        p = len(T)
        if self.q == 0:
            return DOptimality().log_information(M, T, unit)
        if self.q == 1:
            return AOptimality().log_information(M, T, unit * p)
        least, constraints = self._least_eigenvalues(M, T, unit)
        return cp.log(cp.pnorm(least, -self.q)) + np.log(p) / self.q, constraints

    def _least_eigenvalues(
        self, M: "cp.Expression", T: Array, unit: float
    ) -> tuple["cp.Variable", list["cp.Constraint"]]:
        """Numbers l (p,), rising, that the eigenvalues of X unit majorise; see `formulation`."""
        import cvxpy as cp

        p = len(T)
        # The cost of a design in the unit `unit` is that of X unit; both then are of order one.
        S = np.linalg.inv(T) * np.sqrt(unit)
        X = S.T @ M @ S
        X = 0.5 * (X + X.T)  # symmetric, which cvxpy cannot tell
        least = cp.Variable(p, nonneg=True)
        sums = [cp.sum(least[:k]) <= cp.lambda_sum_smallest(X, k) for k in range(1, p)]
        order = [cp.diff(least) >= 0] if p > 1 else []
        return least, [*sums, cp.sum(least) <= cp.trace(X), *order]

    def curvature(self, R: Array) -> Curvature:
        """The q-th part of that of ``log trace(cov^q)``; for q = 0 that of D."""
        if self.q == 0:
            return DOptimality().curvature(R)
        return curvature_of_spectrum(R, self.q).power(1 / self.q)

    def covariance_slope(self, cov: Array) -> Array:
        """``V diag((v/f)^(q-1)) V' / p``."""
        if self.q == 0:  # the inverse of cov, which loses no digits in bad units
            return self._cost(cov, cov)[..., None, None] / cov.shape[-1] * guarded_inverse(cov)[1]
        variances, V = _spectrum(cov)
        ratio = variances / self._mean(variances)[..., None]
        return conjugate(V, ratio ** (self.q - 1)) / cov.shape[-1]

    def transformed(self, T: Array) -> Criterion | None:
        """For q = 0 it is a function of the determinant."""
        return TransformedByFactor(self, T) if self.q == 0 else super().transformed(T)

    def cost_of_root(self, L: Array) -> Array:
        """The mean of the squared singular values of L, for q above 0."""
        return self._mean(_squares(np.asarray(np.linalg.svd(L, compute_uv=False))))

    def slope_of_root(self, L: Array) -> Array:
        """``V diag(v (v/f)^(q-1)) V' / p`` for the right singular vectors V of L, for q above 0."""
        _, s, rows = np.linalg.svd(L)
        variances = _squares(s)
        ratio = variances / self._mean(variances)[..., None]
        V = np.swapaxes(rows, -1, -2)
        return conjugate(V, variances * ratio ** (self.q - 1)) / L.shape[-1]

    def _mean(self, variances: Array) -> Array:
        """Mean of order q (...), above zero, of positive numbers (..., p)."""
        # Divided by the largest, no power overflows, whatever the units are.
        top = variances.max(axis=-1)
        mean = ((variances / top[..., None]) ** self.q).mean(axis=-1)
        return np.asarray(top * mean ** (1 / self.q))

    def _cost(self, M: Array, cov: Array) -> Array:
        if self.q == 0:  # eigenvalues lose digits in bad units, a determinant does not
            return np.asarray(np.exp(np.linalg.slogdet(cov).logabsdet / cov.shape[-1]))
        return self._mean(np.maximum(sharp_variances(cov), np.finfo(float).tiny))

    def _gradient(self, M: Array, cov: Array) -> Array:
        if self.q == 0:
            return -self._cost(M, cov)[..., None, None] / M.shape[-1] * cov
        variances, V = _spectrum(cov)
        ratio = variances / self._mean(variances)[..., None]
        return -conjugate(V, variances**2 * ratio ** (self.q - 1)) / M.shape[-1]


def _is_number(q: object) -> bool:
    return isinstance(q, Real) and not isinstance(q, bool)


def _squares(s: Array) -> Array:
    """Squares of singular values, above zero."""
    return np.maximum(np.square(s), np.finfo(float).tiny)


def _spectrum(cov: Array) -> tuple[Array, Array]:
    """Eigenvalues (..., p), positive, and eigenvectors of covariances."""
    variances, V = eigenpairs(cov)
    # Rounding can leave an eigenvalue a little below zero, which has no power.
    return np.maximum(variances, np.finfo(float).tiny), V
