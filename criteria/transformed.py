"""Criteria of parameters that are ill-conditioned, computed in others that are not."""

from typing import TYPE_CHECKING, Any, Self

import numpy as np

from criteria.convex_criterion import ConvexCriterion
from criteria.criterion import DESCRIBED, CovarianceCriterion, Criterion, DeterminantCriterion
from criteria.curvature import Curvature
from criteria.linalg.inverse import lowered_root, whitener
from criteria.linalg.spectrum import have_orthogonal_columns, is_semidefinite
from criteria.linalg.typing import Array
from criteria.relaxable import Formulation, Relaxable, SpectralBand

if TYPE_CHECKING:
    import cvxpy as cp

# What a function of other parameters takes over from the criterion, with what its relaxation needs.
DECLARED = (
    *DESCRIBED,
    "shown",
    "expression_power",
    "most_subproblems",
    "has_logarithm",
    "batched_curvature",
)


class Transformed(Relaxable):
    """A criterion of k as a function of the information about k', where ``k = T k'``.

    The information about k' is ``M' = T'M T``, and the cost is that of M to the last digit that T
    allows: the covariance ``T cov' T'`` of k is a product, and nothing is inverted in parameters
    where it could not be. A multiplier Z' of M' is the multiplier ``T Z' T'`` of M.

    Args:
        base: The criterion of k, whose cost needs all parameters.
        T: Regular matrix (p, p).
    """

    def __init__(self, base: Relaxable, T: Array) -> None:
        self.base = base
        self.T = T
        self.S = np.asarray(np.linalg.inv(T), dtype=float)
        for key in DECLARED:
            setattr(self, key, getattr(base, key))

    @property
    def label(self) -> str:
        """The base's."""
        return self.base.label

    @property
    def trace_root(self) -> Array:
        """The inverse S of T: ``<S S', M'>`` is the trace of the information about k."""
        return self.S

    @property
    def order(self) -> int:
        """As many as T transforms."""
        return len(self.T)

    @property
    def arguments(self) -> dict[str, Any]:
        """The base's."""
        return self.base.arguments

    @property
    def plan_criterion(self) -> Criterion:
        """The base's, of the same parameters."""
        base = self.base.plan_criterion
        return self if base is self.base else base.transformed(self.T) or self

    def cost_from_plan_criterion(self, cost: float) -> float:
        """The base's."""
        return self.base.cost_from_plan_criterion(cost)

    def smoothed(self, sharpness: float) -> Self:
        """The smoothed base, of the same parameters."""
        base = self.base.smoothed(sharpness)
        return self if base is self.base else type(self)(base, self.T)

    def in_units(self, T: Array) -> Self:
        """The base as a function of k'' where ``k' = T k''``."""
        return type(self)(self.base, self.T @ T)

    def transformed(self, T: Array) -> "Relaxable":
        """The base as a function of k'' where ``k' = T k''``."""
        return self.in_units(T)

    def curvature(self, R: Array) -> Curvature | None:
        """The base's at the root ``T R`` of the covariance of k."""
        return self.base.curvature(self.T @ R)

    def variance_rows(self, p: int) -> Array | None:
        """The base's, times T."""
        found = self.base.variance_rows(p)
        return None if found is None else found @ self.T

    def spectral_band(self, p: int) -> SpectralBand | None:
        """The base's for the information about k'."""
        found = self.base.spectral_band(p)
        return None if found is None else found.transformed(self.T)

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """The base's; where T whitens a design of k', ``T_base T`` whitens it as one of k."""
        return self.base.formulation(M, total, self.T @ T, unit)

    def log_information(
        self, M: "cp.Expression", T: Array, unit: float
    ) -> tuple["cp.Expression", list["cp.Constraint"]]:
        """The base's, see `formulation`."""
        return self.base.log_information(M, self.T @ T, unit)

    def expression(self, M: "cp.Expression", T: Array | None = None) -> "cp.Expression":
        """The base's, see `formulation`."""
        assert isinstance(self.base, ConvexCriterion)
        return self.base.expression(M, self.T if T is None else self.T @ T)

    def polar(self, Z: Array, M: Array) -> float:
        """The base's, of a root ``T F'`` of the multiplier, where ``F'F = Z``."""
        assert isinstance(self.base, ConvexCriterion)
        return self.base.polar_of_root(self.T @ lowered_root(Z).T, self.T @ whitener(M))

    def dual_weights(self, Z: Array, M: Array) -> Array | None:
        """The base's, of the same roots."""
        if type(self.base).dual_weights is Relaxable.dual_weights:
            return None
        assert isinstance(self.base, ConvexCriterion)
        return self.base.dual_weights_of_root(self.T @ lowered_root(Z).T, self.T @ whitener(M))

    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """The base's: of polars where it has them, else of the multipliers ``T Z T'``."""
        if type(self.base).lower_bound is not ConvexCriterion.lower_bound:
            return self.base.lower_bound(self._outward(Z), t, self._information(M))
        proofs = zip(Z[is_semidefinite(Z)], t[is_semidefinite(Z)], strict=True)
        return max((self.polar(z, M) * x**-self.degree for z, x in proofs if x > 0), default=0.0)

    def polars(self, Z: Array, M: Array) -> Array:
        """The base's of the multipliers ``T Z T'``, where it tells all at once."""
        if type(self.base).polars is Relaxable.polars:
            return Relaxable.polars(self, Z, M)
        return self.base.polars(self._outward(Z), self._information(M))

    def rests_on_solver(self, Z: Array, M: Array) -> bool:
        """Whether the base's bound does."""
        return self.base.rests_on_solver(self._outward(Z), self._information(M))

    def subproblem(self, Z: Array, t: Array, M: Array) -> Relaxable:
        """The base's, of the same parameters."""
        found = self.base.subproblem(self._outward(Z), t, self._information(M))
        return self if found is self.base else Transformed(found, self.T)

    def _information(self, M: Array) -> Array:
        """The information about k."""
        return self.S.T @ M @ self.S

    def _outward(self, Z: Array) -> Array:
        """Multipliers, or covariances, of k."""
        return self.T @ Z @ self.T.T

    def _cost(self, M: Array, cov: Array) -> Array:
        return self.base.cost_of_regular(self._information(M), self._outward(cov))

    def _gradient(self, M: Array, cov: Array) -> Array:
        G = self.base.gradient_of_regular(self._information(M), self._outward(cov))
        return self.S @ G @ self.S.T


class TransformedCovariance(Transformed, CovarianceCriterion):
    """The same of a criterion that needs the covariance alone."""

    def covariance_slope(self, cov: Array) -> Array:
        """``T' slope T``."""
        assert isinstance(self.base, CovarianceCriterion)
        return self.T.T @ self.base.covariance_slope(self._outward(cov)) @ self.T

    @property
    def _needs_root(self) -> bool:
        """Whether the small variances matter, whose digits a product ``T cov T'`` loses."""
        return type(self.base).cost_of_root is not CovarianceCriterion.cost_of_root  # type: ignore[attr-defined]

    def _cost(self, M: Array, cov: Array) -> Array:
        assert isinstance(self.base, CovarianceCriterion)
        if not self._needs_root:
            outward = self._outward(cov)
            return self.base.cost_of_regular(outward, outward)
        return self.base.cost_of_root(self.T @ _root(cov))

    def _gradient(self, M: Array, cov: Array) -> Array:
        assert isinstance(self.base, CovarianceCriterion)
        if not self._needs_root:
            return -cov @ self.covariance_slope(cov) @ cov
        L = _root(cov)
        return -L @ self.base.slope_of_root(self.T @ L) @ np.swapaxes(L, -1, -2)


class TransformedExpression(Transformed, ConvexCriterion):
    """The same of a criterion that writes no closed form of its cost, or of its polar.

    What is read off its expression is read off it with T, so that nothing is squared.
    """

    def polar(self, Z: Array, M: Array) -> float:
        """A solver's answer in these parameters, unless the base has a closed form."""
        if type(self.base).polar is ConvexCriterion.polar:  # type: ignore[attr-defined]
            return ConvexCriterion.polar(self, Z, M)
        return super().polar(Z, M)

    def rests_on_solver(self, Z: Array, M: Array) -> bool:
        """Unless the base has a closed form, or each Z is minus the gradient at M."""
        if type(self.base).polar is not ConvexCriterion.polar:  # type: ignore[attr-defined]
            return False
        return not (self.smooth and self._are_gradients(Z, M))

    def _cost(self, M: Array, cov: Array) -> Array:
        if type(self.base)._cost is ConvexCriterion._cost:
            return ConvexCriterion._cost(self, M, cov)
        return super()._cost(M, cov)

    def _gradient(self, M: Array, cov: Array) -> Array:
        if type(self.base)._gradient is ConvexCriterion._gradient:
            return ConvexCriterion._gradient(self, M, cov)
        return super()._gradient(M, cov)


class TransformedByFactor(Transformed):
    """The same of a criterion of det M alone: it differs by a power of ``|det T|``, and no more."""

    def __init__(self, base: Relaxable, T: Array) -> None:
        super().__init__(base, T)
        self._log = 2 * float(np.linalg.slogdet(T).logabsdet)
        self._factor = float(np.exp(base.degree * self._log / len(T)))

    @property
    def as_multiple(self) -> tuple[Relaxable, float]:
        """The base, and the power of ``|det T|``."""
        base, factor = self.base.as_multiple
        return base, factor * self._factor

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """The base's of M' itself, in another unit."""
        return self.base.formulation(M, total, T, unit / self._factor)

    def log_information(
        self, M: "cp.Expression", T: Array, unit: float
    ) -> tuple["cp.Expression", list["cp.Constraint"]]:
        """The base's of M' itself, in another unit."""
        return self.base.log_information(M, T, unit / self._factor)

    def polar(self, Z: Array, M: Array) -> float:
        """The base's of Z' itself, times a number."""
        assert isinstance(self.base, ConvexCriterion)
        return self._factor * self.base.polar(Z, M)

    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """The base's of Z' itself, times a number."""
        return self._factor * self.base.lower_bound(Z, t, M)

    def _cost(self, M: Array, cov: Array) -> Array:
        return self._factor * self.base.cost_of_regular(M, cov)

    def _gradient(self, M: Array, cov: Array) -> Array:
        return self._factor * self.base.gradient_of_regular(M, cov)


class TransformedDeterminant(TransformedByFactor, DeterminantCriterion):
    """The same of a `DeterminantCriterion`, which exchanges know how to update."""

    def cost_of_log_determinant(self, log_det: Array, p: int) -> Array:
        """The base's of ``log det M = log det M' - 2 log |det T|``."""
        assert isinstance(self.base, DeterminantCriterion)
        return self.base.cost_of_log_determinant(log_det - self._log, p)


def transformed(base: Criterion, T: Array) -> Transformed | None:
    """A criterion of k as a function of the information about k', where ``k = T k'``.

    Returns:
        The criterion; None for one that has no relaxation, or has inverses of its own.
    """
    if not isinstance(base, Relaxable) or not base.needs_all:
        return None
    if base.of_spectrum and have_orthogonal_columns(T):
        # With ``T = U diag(s)`` and U orthogonal ``T'M T`` and ``diag(s) U'M U diag(s)`` are the
        # same, and U does not matter. Products with a diagonal matrix keep the digits of all
        # entries, be they large or small.
        T = np.diag(np.linalg.norm(T, axis=0))
    if isinstance(base, DeterminantCriterion):
        return TransformedDeterminant(base, T)
    if isinstance(base, CovarianceCriterion):
        return TransformedCovariance(base, T)
    if isinstance(base, ConvexCriterion) and type(base).polar is ConvexCriterion.polar:
        return TransformedExpression(base, T)
    return Transformed(base, T)


def _root(cov: Array) -> Array:
    """L (..., p, p) with ``L L' = cov``."""
    variances, V = np.linalg.eigh(cov)
    return np.asarray(V * np.sqrt(np.maximum(variances, 0.0))[..., None, :])
