"""Criteria for some of the parameters, or for combinations of them; the others are nuisance."""

from copy import copy
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from criteria.criterion import CovarianceCriterion, Criterion, DeterminantCriterion
from criteria.curvature import Curvature
from criteria.errors import CriterionError
from criteria.linalg.estimable import (
    combination,
    combination_names,
    estimable_inverse,
    open_columns,
    open_directions,
    strayed_part,
)
from criteria.linalg.inverse import rounding_of_rows, scaled_inverse, whitener
from criteria.linalg.long_product import long_product
from criteria.linalg.spectrum import is_semidefinite
from criteria.linalg.typing import Array, Indices, Mask
from criteria.relaxable import Formulation, Relaxable, SpectralBand

if TYPE_CHECKING:
    import cvxpy as cp

# Least singular value of unit combinations that do not follow from each other.
DEPENDENT_COMBINATIONS = 1e-10
# Names that a title lists, and those that it begins with where there are more.
MOST_NAMED = 8
FIRST_NAMED = 4
DEPENDENT = 100.0  # condition number of combinations whose covariance keeps its digits


def combinations_of(K: ArrayLike) -> Array:
    """A frozen copy (p, s) of combinations.

    Raises:
        CriterionError: They are not finite, or depend on each other.
    """
    found = np.array(K, dtype=float)
    found = found[:, None] if found.ndim == 1 else found
    if found.ndim != 2 or 0 in found.shape or not np.isfinite(found).all():
        raise CriterionError("interest: expected a finite matrix (p, s), a combination a column")
    length = np.linalg.norm(found, axis=0)
    if not (length > 0).all():
        raise CriterionError("interest: a combination is zero; expected factors that are not")
    s = np.linalg.svd(found / length, compute_uv=False)
    if found.shape[1] > found.shape[0] or s[-1] < DEPENDENT_COMBINATIONS:
        raise CriterionError(
            "interest: a combination follows from the others; expected each to say something new"
        )
    found.flags.writeable = False
    return found


def monotone(base: Criterion) -> Relaxable:
    """The criterion, if it may be applied to a part of the parameters.

    Raises:
        CriterionError: It may not.
    """
    if base.needs_target:
        raise CriterionError(
            f"criterion {base.name!r} says by its target what is of interest; expected a criterion "
            "without a target"
        )
    if not base.takes_interest:
        raise CriterionError(
            f"criterion {base.name!r} says by itself what is of interest; expected one that does "
            "not, such as D or A"
        )
    if not isinstance(base, Relaxable) or not base.monotone or not base.convex:
        raise CriterionError(
            f"criterion {base.name!r} is not monotone and convex; expected one that is, such as D "
            "or A, for a part of the parameters"
        )
    return base


class Interest(Relaxable):
    """A criterion phi of ``C_K(M) = (K' M^- K)^-1``, the information about ``theta = K'k`` alone.

    C_K is what M tells about s combinations of the p parameters where the rest is unknown too
    (Pukelsheim, Optimal Design of Experiments, chapter 3). Columns of the identity choose
    parameters (D_s, A_s); a single column is c-optimality. For a positive definite M it is the
    inverse of the covariance of theta, and by the Gauss-Markov theorem, for every M,

        C_K(M) = min { L M L' : L K = I },

    a minimum of linear functions in the order of matrices. So C_K is concave, and more information
    never lowers it; hence phi(C_K(M)) is convex and monotone if phi is. The minimising L is
    ``C_K K' G`` for any generalised inverse G of M, so that the gradient is ``L' grad phi L``. A
    singular M has a finite cost as long as K'k is estimable; the best designs often are singular.

    Args:
        base: The criterion phi, monotone and convex.
        K: Combinations (p, s), one a column, of full column rank; (p,) for a single one.
        names: What they are called in tables (s,); defaults to words such as "k2 - k3".

    Raises:
        CriterionError: phi is not such a criterion, or K is not such a matrix.
    """

    needs_all = False
    takes_interest = False
    # How many times eps of its length a combination is known to: more where it is a difference of
    # large numbers, as one that other parameters tell.
    rounded: float = 1.0

    def __init__(self, base: Criterion, K: ArrayLike, names: tuple[str, ...] | None = None) -> None:
        self._fill(monotone(base), combinations_of(K), names)

    def _fill(self, base: Relaxable, K: Array, names: tuple[str, ...] | None) -> None:
        """Set all attributes, from arguments that are checked already."""
        self.base = base
        self.K = K
        self._chosen = _chosen(K)
        self.names = combination_names(K) if names is None else names
        self.has_logarithm = base.has_logarithm
        self.batched_curvature = base.batched_curvature
        self._describe(base)

    def _describe(self, base: Relaxable) -> None:
        """Take over what the base declares."""
        self.name = base.name
        self.title = f"{base.title} of {_listed(self.names)}"
        self.formula = base.formula
        self.sense = base.sense
        self.degree = base.degree
        self.convex = base.convex
        self.smooth = base.smooth
        self.unit_free = base.unit_free
        self.shown = base.shown
        self.expression_power = base.expression_power

    @property
    def arguments(self) -> dict[str, Any]:
        """The base's, and the combinations."""
        return {**self.base.arguments, "interest": self.K.tolist()}

    @property
    def label(self) -> str:
        """Such as "D of k2, k3", or "phi (q = 2) of k2, k3"."""
        # A class that is named anew, as Ds is, keeps nothing of what its base is called.
        name = self.base.label if self.name == self.base.name else self.name
        return f"{name} of {_listed(self.names)}"

    @property
    def plan_criterion(self) -> Criterion:
        """The base's, for the same combinations."""
        base = self.base.plan_criterion
        return self if base is self.base else self._with(base)

    def cost_from_plan_criterion(self, cost: float) -> float:
        """The base's."""
        return self.base.cost_from_plan_criterion(cost)

    def smoothed(self, sharpness: float) -> Self:
        """The smoothed base, for the same combinations."""
        return self._with(self.base.smoothed(sharpness))

    def of(self, K: Array) -> Self:
        """The same criterion of other combinations (p, s), as independent as its own."""
        return self._like(self.base, K)

    def named(self, parameters: tuple[str, ...]) -> Self:
        """The same combinations, in words of these parameters (p,)."""
        if len(parameters) != len(self.K):
            return self
        other = copy(self)
        words = tuple(combination(column, parameters) for column in self.K.T)
        other._fill(self.base, self.K, words)
        return other

    def in_units(self, T: Array) -> Self:
        """The combinations of k are ``T'K`` of k', where k = T k'."""
        return self.of(long_product(self.K.T, T).T.astype(float))

    def transformed(self, T: Array) -> Self:
        """The same combinations, told by the other parameters.

        Combinations ``T'K = Q R`` of k' may be nearly dependent, and their covariance has the
        square of that. The base then is a function of the information about ``theta' = Q'k'``,
        of which ``theta = R' theta'``. Where that is because of the units d of the parameters,
        ``T = diag(d) T_d``, they are factorized before T_d mixes rows of different sizes.
        """
        told = long_product(self.K.T, T).T.astype(float)
        base = None
        d = np.linalg.norm(T, axis=1)
        if max(_condition(told), self.dependence(1.0 / d)) > DEPENDENT:
            graded, first = _graded_factors(d[:, None] * self.K)
            Q, R = np.linalg.qr((T / d[:, None]).T @ graded)
            base = self.base.transformed((R @ first).T)
        other = self.in_units(T) if base is None else self._like(base, Q)
        sizes = np.linalg.norm(np.abs(T).T @ np.abs(self.K), axis=0)
        other.rounded = self.rounded * float((sizes / np.linalg.norm(told, axis=0)).max())
        return other

    def inverse(self, M: Array) -> tuple[Array, Array, Mask]:
        """A generalised inverse, and the mask of the matrices that tell all combinations."""
        self.require_order(M.shape[-1])
        return estimable_inverse(M, self.K, self.rounded)

    def whitener(self, M: Array) -> Array:
        """``T = G K F`` (p, s) with ``F' V F = I`` for ``V = K'G K``: ``T' M T = I``."""
        _, cov, _ = self.inverse(M)
        return self.side(cov) @ whitener(self.variance(cov))

    def strayed(self, M: Array) -> float:
        """Of the combinations, see `strayed_part`."""
        return strayed_part(M, self.K)

    def missing(self, M: Array, parameters: tuple[str, ...]) -> tuple[str, ...]:
        """The combinations that M leaves open, each with the directions that hide it."""
        self.require_order(M.shape[-1])
        is_open = open_columns(M, self.K, self.rounded)
        if not is_open.any():
            return ()
        hidden = " and ".join(open_directions(M, parameters)) or "other parameters"
        words = [combination(column, parameters) for column in self.K.T[is_open]]
        return tuple(f"{each} (open: {hidden})" if each != hidden else each for each in words)

    def dependence(self, scale: Array) -> float:
        """That of the combinations; of single parameters it is one."""
        return 1.0 if self._chosen is not None else _condition(self.K / scale[:, None])

    def rounding(self, W: Array) -> float:
        """That of the least exact of the combinations."""
        return float(rounding_of_rows(self.K.T[:, None], W).max())

    def side(self, cov: Array) -> Array:
        """``cov K`` (..., p, s); any rows (..., n, p) may stand for cov."""
        return cov @ self.K if self._chosen is None else cov[..., self._chosen]

    def variance(self, cov: Array) -> Array:
        """Covariance ``K' cov K`` (..., s, s) of what is of interest."""
        side = self.side(cov)
        return self.K.T @ side if self._chosen is None else side[..., self._chosen, :]

    def cost_of_variance(self, variance: Array) -> Array:
        """Costs (...) of what is of interest with covariances (..., s, s)."""
        base = self.base
        if isinstance(base, DeterminantCriterion):
            log_det = -np.linalg.slogdet(variance).logabsdet
            return base.cost_of_log_determinant(log_det, variance.shape[-1])
        if isinstance(base, CovarianceCriterion):
            return base.cost_of_regular(variance, variance)
        return base.cost_of_regular(scaled_inverse(variance), variance)

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """The base's program for any N with ``K N K' <= M``, of which C_K is the largest.

        In whitened parameters K is ``T'K = Q R``. With ``N' = R N R'`` the constraint reads
        ``Q N' Q' <= M``, and its solution is near the identity: N' is the information about theta'
        where ``theta = R' theta'``.
        """
        N, R, below = self._part_of(M, T)
        objective, constraints = self.base.formulation(N, total, R.T, unit)
        return objective, [below, *constraints]

    def log_information(
        self, M: "cp.Expression", T: Array, unit: float
    ) -> tuple["cp.Expression", list["cp.Constraint"]]:
        """The base's for the same N."""
        N, R, below = self._part_of(M, T)
        objective, constraints = self.base.log_information(N, R.T, unit)
        return objective, [below, *constraints]

    def _part_of(
        self, M: "cp.Expression", T: Array
    ) -> tuple["cp.Variable", Array, "cp.Constraint"]:
        """The variable N', with R and the constraint that holds it below M; see `formulation`."""
        import cvxpy as cp

        Q, R = np.linalg.qr(T.T @ self.K)
        s = self.K.shape[1]
        N = cp.Variable((s, s), symmetric=True)
        # cvxpy cannot tell that Q N Q' is symmetric, and asks for it.
        part = Q @ N @ Q.T
        return N, R, M - 0.5 * (part + part.T) >> 0

    def rests_on_solver(self, Z: Array, M: Array) -> bool:
        """Whether the base's bound does."""
        _, cov, _ = self.inverse(M)
        told, _ = self._told(Z)
        return self.base.rests_on_solver(told, scaled_inverse(self.variance(cov)))

    def dual_weights(self, Z: Array, M: Array) -> Array | None:
        """The base's for ``K'Z K``, see `lower_bound`."""
        _, cov, _ = self.inverse(M)
        told, _ = self._told(Z)
        return self.base.dual_weights(told, scaled_inverse(self.variance(cov)))

    def lower_bound(self, Z: Array, t: Array, M: Array) -> float:
        """The base's for ``K'Z K``: as ``X >= K C_K(X) K'``, ``<K'Z K, C_K(X)> <= <Z, X> <= t``."""
        _, cov, _ = self.inverse(M)
        N = scaled_inverse(self.variance(cov))
        # K'Z K may be semidefinite although Z is not, and then proves nothing.
        proves = is_semidefinite(Z)
        if not proves.any():
            return 0.0
        told, power = self._told(Z[proves])
        return self.base.lower_bound(told, np.ldexp(t[proves], power), N)

    def _told(self, Z: Array) -> tuple[Array, Indices]:
        """``2^power K'Z K`` (..., s, s) and the power (...), with ``2^power Z`` of order one.

        A multiplier proves the same at any length; in far units K'Z K of a long one is no double.
        """
        power = -np.frexp(np.abs(Z).max(axis=(-2, -1)))[1]
        return self.K.T @ np.ldexp(Z, power[..., None, None]) @ self.K, power

    def curvature(self, R: Array) -> Curvature | None:
        """The base's at C_K, and what the nuisance parameters add to it.

        ``R'K = Q B`` with Q = (Q_1, Q_2) orthogonal gives the root B' of the covariance of K'k. Let
        the base there have V, z and W. With ``(Q_1 V, Q_2)`` a change E of M changes C_K, in the
        base's parameters, by the Schur complement of the second block of ``I + E``: by ``E_11`` in
        first order and by ``-E_12 E_21`` in second. So each pair (a, b) of the two blocks weighs
        z_a.
        """
        s = self.K.shape[1]
        Q, B = np.linalg.qr(np.swapaxes(R, -1, -2) @ self.K, mode="complete")
        base = self.base.curvature(np.swapaxes(B[..., :s, :], -1, -2))
        if base is None:
            return None
        W = np.zeros(R.shape)
        W[..., :s, :s] = base.W
        W[..., :s, s:] = base.z[..., :, None]
        W[..., s:, :s] = base.z[..., None, :]
        z = np.zeros(R.shape[:-1])
        z[..., :s] = base.z
        V = np.concatenate([Q[..., :s] @ base.V, Q[..., s:]], axis=-1)
        return Curvature(V, z, W, base.c)

    def variance_rows(self, p: int) -> Array | None:
        """The base's, of the combinations."""
        found = self.base.variance_rows(self.K.shape[1])
        return None if found is None else found @ self.K.T

    def spectral_band(self, p: int) -> SpectralBand | None:
        """``C_K >= F`` is ``M >= K F K'``; an upper bound of C_K has no such form."""
        found = self.base.spectral_band(self.K.shape[1])
        if found is None or found.a:
            return None
        return SpectralBand(0.0, found.b, self.K @ found.floor @ self.K.T, np.eye(p))

    @property
    def order(self) -> int:
        """Number of parameters that are combined."""
        return len(self.K)

    def require_order(self, p: int) -> None:
        """Check that combinations are of so many parameters.

        Raises:
            CriterionError: They are not.
        """
        if len(self.K) != p:
            raise CriterionError(
                f"interest: combinations of {len(self.K)} parameters; expected {p}, as the "
                "information matrix has"
            )

    def _with(self, base: Criterion) -> Self:
        """Another base for the same combinations; this object itself for the same base."""
        # The relaxation keeps compiled programs by object, so an equal one is not made anew.
        return self if base is self.base else self._like(base, self.K)

    def _like(self, base: Criterion, K: Array) -> Self:
        """A criterion of the same kind and names with another base or other combinations."""
        # In other units combinations stay independent, though they may not look it any more: they
        # are not checked again.
        other = copy(self)
        other._fill(monotone(base), K, self.names)
        return other

    def _cost(self, M: Array, cov: Array) -> Array:
        return self.cost_of_variance(self.variance(cov))

    def _gradient(self, M: Array, cov: Array) -> Array:
        side = self.side(cov)
        variance = self.variance(cov)
        if isinstance(self.base, CovarianceCriterion):
            slope = -self.base.covariance_slope(variance)
        elif isinstance(self.base, DeterminantCriterion):
            # A function of det N has a gradient along N^-1, and <gradient, N> = -degree cost.
            factor = -self.degree / variance.shape[-1] * self.cost_of_variance(variance)
            slope = factor[..., None, None] * scaled_inverse(variance)
        else:
            N = scaled_inverse(variance)
            slope = N @ self.base.gradient_of_regular(N, variance) @ N
        return side @ slope @ np.swapaxes(side, -1, -2)


def _condition(K: Array) -> float:
    """Condition number of combinations (p, s) of the same length, one a column."""
    s = np.linalg.svd(K / np.linalg.norm(K, axis=0), compute_uv=False)
    return float(s[0] / s[-1]) if s[-1] > 0 else np.inf


def _graded_factors(K: Array) -> tuple[Array, Array]:
    """Q (p, s) with orthogonal columns and R (s, s), ``Q R = K``, where rows of K differ in size.

    Householder's reflections with columns exchanged are stable row by row if the largest rows come
    first (Cox and Higham, Stability of Householder QR factorization for weighted least squares
    problems, 1998).
    """
    from scipy.linalg import qr  # where it is needed

    rows = np.argsort(-np.abs(K).max(axis=1), kind="stable")
    Q, R, columns = qr(K[rows], mode="economic", pivoting=True)
    return Q[np.argsort(rows)], R[:, np.argsort(columns)]


def _chosen(K: Array) -> Indices | None:
    """The parameters (s,) that the columns of K choose; None if one is a true combination."""
    if not np.isin(K, (0.0, 1.0)).all() or not (K.sum(axis=0) == 1).all():
        return None
    return K.argmax(axis=0)


def _listed(names: tuple[str, ...]) -> str:
    """Names in a title, of many the first ones."""
    if len(names) <= MOST_NAMED:
        return ", ".join(names)
    return f"{', '.join(names[:FIRST_NAMED])} and {len(names) - FIRST_NAMED} more"
