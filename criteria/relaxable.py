"""The second interface of a criterion: what the convex relaxation asks of it.

Parameters may be ill-conditioned: the criterion is then computed in others that are not.
"""

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol, Self

import numpy as np

from criteria.criterion import DESCRIBED, CovarianceCriterion, Criterion, DeterminantCriterion
from criteria.curvature import Curvature
from criteria.linalg.inverse import eigenpairs, lowered_root, whitener
from criteria.linalg.models import Models
from criteria.linalg.spectrum import have_orthogonal_columns, is_semidefinite
from criteria.linalg.typing import Array

if TYPE_CHECKING:
    import cvxpy as cp

ILL_CONDITIONED = 1e3  # condition number of R: duals have its square
# What a function of other parameters takes over from the criterion, with what its relaxation needs.
DECLARED = (
    *DESCRIBED,
    "shown",
    "expression_power",
    "most_subproblems",
    "has_logarithm",
    "batched_curvature",
)


@dataclass(frozen=True, eq=False)
class SpectralBand:
    """The program ``min b sum(w) + a kappa``, ``w >= 0``, with ``F <= M(w), R'M(w) R <= kappa I``.

    The upper bound is ``M <= kappa C`` for ``C^-1 = R R'``. In parameters that are very different
    from those of the criterion C has the squares of a large condition number, and would leave no
    digits of its small entries; what counts in R are its large ones.

    Attributes:
        a: Weight of the upper bound, at least zero; zero where there is none.
        b: Weight of the sum of the weights, at least zero.
        floor: F (p, p), positive semidefinite.
        cap: R (p, p), regular.
    """

    a: float
    b: float
    floor: Array
    cap: Array

    @classmethod
    def of(cls, a: float, b: float, p: int) -> "SpectralBand":
        """That of eigenvalues themselves, ``I <= M <= kappa I``."""
        return cls(a, b, np.eye(p), np.eye(p))

    @property
    def is_graded(self) -> bool:
        """Whether the upper bound is so uneven that its dual is lost beside that of the lower."""
        return bool(self.a and np.linalg.cond(self.cap) > ILL_CONDITIONED)

    def transformed(self, T: Array) -> "SpectralBand":
        """The same program for the information ``T'M T``."""
        return replace(
            self, floor=T.T @ self.floor @ T, cap=np.asarray(np.linalg.solve(T, self.cap))
        )


class Losses(Protocol):
    """Smooth losses ``f_j(M)`` of degree one, of which a cost is the largest.

    Attributes:
        models: Of several models side by side, one a loss; None where all losses are about all.
    """

    models: Models | None

    def logs_and_slopes(self, M: Array) -> tuple[Array, Array]:
        """``log f_j`` (k,) at M (p, p), and minus their gradients (k, p, p)."""
        ...

    def loss_curvatures(self, R: Array) -> tuple[Curvature, ...] | None:
        """The derivatives of each ``log f_j`` at a root R (p, p) of the covariance, if known."""
        ...


Formulation = tuple["cp.Expression", list["cp.Constraint"]]


class Relaxable(Criterion):
    """A criterion that the relaxation can minimise over the weights of candidates, with a bound.

    The relaxation solves a convex program (`formulation`) and takes from its answer a multiplier Z
    of ``M == sum w_i M_i``. Every design X obeys ``<Z, X> <= t``, where t is the largest
    sensitivity ``<Z, M_i>`` of a candidate; `lower_bound` turns that into a bound on the cost.

    Attributes:
        expression_power: The program's objective is ``cost**expression_power``.
        has_logarithm: Whether `log_information` is there.
        of_spectrum: Whether it is a function of the eigenvalues of M, some of which are small: it
            is then computed in parameters of which these are nearly the lengths.
        most_subproblems: How many convex programs may be solved one after another. One, unless the
            criterion is the least of a family of which `subproblem` names the members; then the
            multipliers of several members prove the bound together.
    """

    # A root such as rho0 has no convex program of its own kind; its square has.
    expression_power: float = 1.0
    most_subproblems: int = 1
    has_logarithm: bool = False
    of_spectrum: bool = False

    @abstractmethod
    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """The relaxation as a convex program: an objective to minimise, and its constraints.

        The weights that solve it may have any sum; divided by that sum they are the design.

        Args:
            M: Symmetric (p, p) expression, ``sum w_i M_i`` for parameters k' where k = T k'.
            total: The sum of the weights.
            T: Regular matrix (p, p) that whitens a design near the optimum.
            unit: The cost of that design. The objective is measured in this unit.
        """

    @property
    def as_multiple(self) -> "tuple[Relaxable, float]":
        """A criterion and a number such that their product is this criterion."""
        return self, 1.0

    def dual_weights(self, Z: Array, M: Array) -> Array | None:
        """The weights by which a criterion that is a maximum turns a multiplier into a bound.

        They are stored with a certificate, so that a check needs no search for them.

        Args:
            Z: A multiplier (p, p).
            M: A regular design (p, p), near which the bound shall be tight.

        Returns:
            Weights of sum one; None for a criterion that needs none.
        """
        return None

    def log_information(
        self, M: "cp.Expression", T: Array, unit: float
    ) -> tuple["cp.Expression", list["cp.Constraint"]]:
        """A concave expression of ``-log(cost / unit) / degree``, and its constraints.

        It serves compound criteria, whose logarithm is a sum of these; see `has_logarithm`.

        Args:
            M: See `formulation`.
            T: See `formulation`.
            unit: See `formulation`.

        Raises:
            NotImplementedError: The criterion has no such form.
        """
        raise NotImplementedError(f"criterion {self.name} has no logarithm of a convex form")

    def spectral_band(self, p: int) -> SpectralBand | None:
        """The relaxation as a program of extreme eigenvalues, which a method of its own solves.

        Args:
            p: Number of parameters.

        Returns:
            The program; None where the criterion has no such form.
        """
        return None

    def variance_rows(self, p: int) -> Array | None:
        """Rows A_j of which the relaxation minimises the largest ``trace(A_j cov A_j')``.

        Args:
            p: Number of parameters.

        Returns:
            The rows (j, r, p); None where the criterion has no such form.
        """
        return None

    def largest_of(self, p: int) -> Losses | None:
        """Smooth losses of which the cost is the largest.

        Args:
            p: Number of parameters.

        Returns:
            The losses; None where the criterion has no such form.
        """
        return None

    @abstractmethod
    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """A lower bound on the cost of every design X with ``<Z_j, X> <= t_j`` for all j.

        For a criterion of degree zero, designs have unit trace.

        Args:
            Z: Symmetric multipliers (r, p, p), positive semidefinite if the criterion is monotone.
            t: The largest sensitivity (r,) of a candidate to each multiplier.
            M: A regular design (p, p), near which the bound shall be tight.
        """

    @property
    def bounds_by_polars(self) -> bool:
        """Whether `lower_bound` is the best that one multiplier proves by its `polar`."""
        return False

    def polar(self, Z: Array, M: Array) -> float:
        """A lower bound on ``cost(X)`` over all X with ``<Z, X> <= 1``: what one multiplier proves.

        Args:
            Z: Multiplier (p, p), positive semidefinite if the criterion is monotone.
            M: A regular design (p, p), near which the bound shall be tight.
        """
        return self.lower_bound(Z[None], np.ones(1), M)

    def polar_of_root(self, B: Array, W: Array) -> float:
        """`polar` of ``Z = B B'``, for a criterion of parameters in which Z would lose digits.

        Args:
            B: A root (p, q) of the multiplier.
            W: Whitens a design near which the bound shall be tight (p, p): ``W' M W = I``.
        """
        S = np.linalg.inv(W)
        return self.polar(B @ B.T, S.T @ S)

    def dual_weights_of_root(self, B: Array, W: Array) -> Array | None:
        """The weights that `polar_of_root` takes, see `dual_weights`."""
        S = np.linalg.inv(W)
        return self.dual_weights(B @ B.T, S.T @ S)

    def polars(self, Z: Array, M: Array) -> Array:
        """What each of many multipliers proves alone: `lower_bound` with a largest sensitivity one.

        Args:
            Z: Symmetric multipliers (b, p, p), positive semidefinite.
            M: A regular design (b, p, p) for each.

        Returns:
            Bounds (b,); zero where a multiplier proves nothing.
        """
        one = np.ones(1)
        pairs = zip(Z[:, None], M, strict=True)
        return np.array([self.lower_bound(own, one, near) for own, near in pairs])

    def rests_on_solver(self, Z: Array, M: Array) -> bool:
        """Whether `lower_bound` near M believes a solver's optimum, for any of multipliers Z."""
        return False

    def subproblem(self, Z: Array, t: Array, M: Array) -> "Relaxable":
        """The problem to solve next: the criterion itself, or a member of its family.

        Args:
            Z: Multipliers (r, p, p) found so far, r may be zero.
            t: The largest sensitivity (r,) of a candidate to each multiplier.
            M: The best design (p, p) so far.
        """
        return self

    def transformed(self, T: Array) -> "Criterion | None":
        """This criterion of k as a function of the information about k', where ``k = T k'``.

        Returns:
            The criterion; None for one that has inverses of its own.
        """
        if not self.needs_all:
            return None
        if self.of_spectrum and have_orthogonal_columns(T):
            # With ``T = U diag(s)`` and U orthogonal ``T'M T`` and ``diag(s) U'M U diag(s)`` are
            # the same, and U does not matter. Products with a diagonal matrix keep the digits of
            # all entries, be they large or small.
            T = np.diag(np.linalg.norm(T, axis=0))
        if isinstance(self, DeterminantCriterion):
            return TransformedDeterminant(self, T)
        if isinstance(self, CovarianceCriterion):
            return TransformedCovariance(self, T)
        return Transformed(self, T)


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
        return self.base.expression(M, self.T if T is None else self.T @ T)  # type: ignore[attr-defined]

    def polar(self, Z: Array, M: Array) -> float:
        """The base's, of a root ``T F'`` of the multiplier, where ``F'F = Z``."""
        return self.base.polar_of_root(self.T @ lowered_root(Z).T, self.T @ whitener(M))

    def dual_weights(self, Z: Array, M: Array) -> Array | None:
        """The base's, of the same roots."""
        if type(self.base).dual_weights is Relaxable.dual_weights:
            return None
        return self.base.dual_weights_of_root(self.T @ lowered_root(Z).T, self.T @ whitener(M))

    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """The base's: of polars where it has them, else of the multipliers ``T Z T'``."""
        if not self.base.bounds_by_polars:
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


def _root(cov: Array) -> Array:
    """L (..., p, p) with ``L L' = cov``."""
    variances, V = eigenpairs(cov)
    return np.asarray(V * np.sqrt(np.maximum(variances, 0.0))[..., None, :])
