"""Costs of a plan after each of many exchanges, without an inverse for each."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from criteria import Criterion, Interest
from criteria.criterion import DeterminantCriterion
from criteria.linalg.inverse import guarded_inverse
from criteria.linalg.logarithms import log_determinant
from criteria.linalg.typing import triangle
from edtk.design.problem import Problem
from edtk.system.typing import Array, Mask

SAME_SLOPE = 1e-9  # relative difference of two slopes that are the same
# The inverse of R is updated only where its least eigenvalue, at unit diagonal, is above this, and
# where no diagonal entry is below this share of the information that joins. A smaller entry may be
# the rounding of a zero: after the only pose that excites a parameter is taken out, R had 1e-20 of
# the other entries there, positive definite by chance, and its update was noise.
UPDATABLE = 1e-6
MOST_ROWS = 6  # of a candidate: the elimination of many is a loop over pairs of rows
MOST_ENTRIES = 2**19  # of all candidates' information: of more, only the most sensitive are tried
COSTS_AT_ONCE = 20_000  # their triangles, of a megabyte, stay in a core's cache


def constant_slope(criterion: Criterion, mean: Array) -> Array | None:
    """W (p, p) where the criterion's cost is a power q of ``tr(W cov)``; None for other criteria.

    The trace itself, ``cost^(1/q)`` with the degree q, has the gradient ``-cov W cov``. So minus M
    times that times M is the same at every M, and its product with the covariance is the trace.

    Args:
        criterion: The criterion.
        mean: A regular information matrix (p, p).
    """
    if not criterion.smooth or criterion.degree <= 0:
        return None
    L = np.linalg.cholesky(mean)
    p = len(mean)
    spread = np.array([np.ones(p), np.linspace(1.0, 2.0, p), np.linspace(3.0, 1.0, p) ** 2])
    cost, G = criterion.cost_and_gradient((L * spread[:, None]) @ L.T)
    trace = cost ** (1.0 / criterion.degree)
    found = -spread[:, :, None] * (L.T @ G @ L) * spread[:, None]
    found *= (trace / (criterion.degree * cost))[:, None, None]
    # The trace of the whitened slope with the covariance, which is diagonal here.
    told = (np.diagonal(found, axis1=1, axis2=2) / spread).sum(axis=1)
    if not (np.abs(told - trace) <= SAME_SLOPE * trace).all():
        return None
    size = np.abs(found[0]).max()
    if not np.abs(found - found[0]).max() <= SAME_SLOPE * size:
        return None
    return np.asarray(L @ found[0] @ L.T)


def exchange_costs(
    criterion: Criterion,
    rest: Array,
    factors: Array,
    times: Array,
    leaving: Array | None = None,
) -> Array:
    """Compute the costs of ``R_i + r_i U_ij' U_ij``, by an update wherever it is accurate.

    ``det(R + r U' U) = det(R) det(I + r U R^-1 U')`` serves criteria of the determinant alone, and
    ``(R + r U' U)^-1 = R^-1 - R^-1 U' (I/r + U R^-1 U')^-1 U R^-1`` serves all others. Of a part of
    the parameters only their covariance is updated. Where R is nearly singular, as without any
    place of a saturated plan, the place's own rows are traded for others, see `trade_costs`; or, if
    they are not given, the sum is formed and inverted itself.

    Args:
        criterion: The criterion.
        rest: Information R (k, p, p) of a plan without the measurements of one place.
        factors: Rows U (k, n, rows, p) of the candidates for that place.
        times: Repetitions r (k,) of the place.
        leaving: Rows (k, rows, p) of the place, without which R is, where it has no repetitions.

    Returns:
        Costs (k, n).
    """
    _, cov, regular = guarded_inverse(rest, UPDATABLE)
    # Sums and maxima over the last axis are many times as fast as over others.
    columns = np.ascontiguousarray(np.moveaxis(factors, -1, 1))
    largest = times[:, None] * np.square(columns).sum(axis=-1).max(axis=-1)
    regular = regular & no_smaller_than_rounding(rest, largest)
    if regular.all():
        return _updated_costs(criterion, rest, cov, factors, times)
    costs = np.empty(factors.shape[:2])
    direct = ~regular
    if leaving is None:
        joining = times[direct, None, None, None] * _squares(factors[direct])
        costs[direct] = criterion.cost(rest[direct, None] + joining)
    else:
        own = leaving[direct]
        M = rest[direct] + _squares(own)
        inverse = guarded_inverse(M, UPDATABLE)[1:]
        costs[direct] = trade_costs(criterion, M, inverse, factors[direct], own[:, None])
    if regular.any():
        arrays = (array[regular] for array in (rest, cov, factors, times))
        costs[regular] = _updated_costs(criterion, *arrays)
    return costs


def no_smaller_than_rounding(rest: Array, joining: Array) -> Mask:
    """Whether each R (k,) has diagonal entries that rounding cannot have left.

    Args:
        rest: Information R (k, p, p).
        joining: The largest diagonal entries (k, p) of what may join it.
    """
    diagonal = np.diagonal(rest, axis1=-2, axis2=-1)
    return np.asarray((diagonal >= UPDATABLE * joining).all(axis=1), dtype=bool)


def _updated_costs(
    criterion: Criterion, rest: Array, cov: Array, factors: Array, times: Array
) -> Array:
    """Costs (k, n) by the lemmas, where the inverses ``cov = R^-1`` (k, p, p) are accurate.

    The times are one for all rows (k,), or one for each (k, rows): rows of negative ones leave.
    """
    r = times.reshape(len(times), 1, -1, 1)
    if isinstance(criterion, Interest) and isinstance(criterion.base, DeterminantCriterion):
        return _determinants_of_interest(criterion, criterion.base, cov, factors, r)
    k, n, rows, p = factors.shape
    # One product for all candidates of a plan.
    W = (factors.reshape(k, n * rows, p) @ cov).reshape(factors.shape)
    S = W @ np.swapaxes(factors, -1, -2)
    eye = np.eye(rows)
    if isinstance(criterion, DeterminantCriterion):
        log_det = np.linalg.slogdet(rest).logabsdet[:, None]
        return criterion.cost_of_log_determinant(log_det + log_determinant(eye + r * S), p)
    if isinstance(criterion, Interest):
        told = criterion.side(W)
        fall = np.swapaxes(told, -1, -2) @ np.linalg.solve(eye / r + S, told)
        return criterion.cost_of_variance(criterion.variance(cov)[:, None] - fall)
    updated = cov[:, None] - np.swapaxes(W, -1, -2) @ np.linalg.solve(eye / r + S, W)
    joining = np.swapaxes(factors, -1, -2) @ (r * factors)
    return criterion.cost_of_regular(rest[:, None] + joining, updated)


def _squares(factors: Array) -> Array:
    """Information ``U'U`` (..., p, p) of rows U (..., rows, p)."""
    return np.asarray(np.swapaxes(factors, -1, -2) @ factors)


def trade_costs(
    criterion: Criterion, M: Array, inverse: tuple[Array, Mask], joining: Array, leaving: Array
) -> Array:
    """Compute the costs of ``M_i + U_ij' U_ij - V_ij' V_ij``, by an update wherever it is accurate.

    The rows F of U and V together, with the signs J of both, multiply the determinant by
    ``det(I + J F M^-1 F')`` (Fedorov 1972, for one row each), and the lemmas of `exchange_costs`
    hold with J for r. Where M is nearly singular, or this ratio is near zero, the sum is formed
    and inverted itself.

    Args:
        criterion: The criterion.
        M: Information (k, p, p) of plans.
        inverse: Inverses (k, p, p), and where they are accurate (k,), see `UPDATABLE`.
        joining: Rows U (k, n, rows, p), or (k, 1, rows, p) the same for all n.
        leaving: Rows V (k, n, rows, p), or (k, 1, rows, p), of which M has information.

    Returns:
        Costs (k, n).
    """
    cov, accurate = inverse
    rows = joining.shape[2]
    largest = np.square(joining).sum(axis=2).max(axis=1)
    accurate = accurate & no_smaller_than_rounding(M, largest)
    F = np.concatenate(np.broadcast_arrays(joining, leaving), axis=2)
    signs = np.repeat([1.0, -1.0], rows)
    products = (F @ cov[:, None]) @ np.swapaxes(F, -1, -2)
    ratio = np.linalg.det(np.eye(2 * rows) + signs[:, None] * products)
    told = accurate[:, None] & (ratio > UPDATABLE)
    times = np.tile(signs, (len(M), 1))
    costs = _updated_costs(criterion, M, cov, np.where(told[:, :, None, None], F, 0.0), times)
    plans, some = (~told).nonzero()
    if len(plans):
        own = F[plans, some]
        change = np.swapaxes(own, 1, 2) @ (signs[:, None] * own)
        costs[plans, some] = criterion.cost(M[plans] + change)
    return costs


def _determinants_of_interest(
    criterion: Interest, base: DeterminantCriterion, cov: Array, factors: Array, r: Array
) -> Array:
    """Costs (k, n) of a criterion of ``det C_K``, by the determinant lemma alone.

    With the covariance V of K'k under R, and what remains of R^-1 for the nuisance parameters,
    ``P = R^-1 - R^-1 K V^-1 K' R^-1``, the determinant becomes
    ``det C_K det(I + r U R^-1 U') / det(I + r U P U')``.
    """
    variance = criterion.variance(cov)
    side = criterion.side(cov)
    P = cov - side @ np.linalg.solve(variance, np.swapaxes(side, -1, -2))
    # One product for both, and determinants written out: the lemma is as fast as that of det R.
    both = factors @ np.concatenate([cov, P], axis=-1)[:, None]
    p = cov.shape[-1]
    U = np.swapaxes(factors, -1, -2)
    eye = np.eye(factors.shape[-2])
    log_det = -np.linalg.slogdet(variance).logabsdet[:, None]
    log_det = log_det + log_determinant(eye + r * (both[..., :p] @ U))
    log_det = log_det - log_determinant(eye + r * (both[..., p:] @ U))
    return base.cost_of_log_determinant(log_det, variance.shape[-1])


@dataclass(frozen=True, eq=False)
class CandidatePrices:
    """Costs of plans whose rest R is joined by a candidate U, for all candidates at once.

    `exchange_costs` is the same for any criterion. The lemmas there need ``S = U C U'`` with
    ``C = R^-1``, and for a cost that is a power q of ``tr(W C)`` also ``E = U C W C U'``, since
    ``tr(W C)`` falls by ``tr((I/r + S)^-1 E)``. Each entry ``u_a C u_b'`` is linear in C, with the
    products of two rows of U as its coefficients. One matrix product therefore gives S of all
    candidates and plans, in a tenth of the time of a product for each of them.

    Attributes:
        criterion: The criterion.
        problem: The candidates (n).
        products: Coefficients (q, s, n) of the q = p(p+1)/2 entries of C in the s entries of S.
        slope: W (p, p); None for criteria of the determinant.
    """

    criterion: Criterion
    problem: Problem
    products: Array
    slope: Array | None

    @classmethod
    def of(cls, criterion: Criterion, problem: Problem) -> "CandidatePrices | None":
        """The prices of candidates; None where they or the criterion do not suit."""
        if problem.n * problem.p**2 > MOST_ENTRIES:
            return None
        slope = None
        if not isinstance(criterion, DeterminantCriterion):
            slope = _slope_of(criterion, problem.p)
            if slope is None:
                return None
        U = problem.factors()
        if U.shape[1] > MOST_ROWS:
            return None
        i, j = triangle(problem.p)
        a, b = triangle(U.shape[1])
        rows = U.transpose(2, 1, 0)
        products = rows[i][:, a] * rows[j][:, b]
        # An entry off the diagonal of C stands for two.
        off = i != j
        products[off] += rows[j[off]][:, a] * rows[i[off]][:, b]
        return cls(criterion, problem, products, slope)

    def costs(self, rest: Array, times: Array) -> Array:
        """Costs (k, n) of ``R_i + r_i U_j' U_j``.

        Args:
            rest: Information R (k, p, p).
            times: Repetitions r (k,).
        """
        _, cov, regular = guarded_inverse(rest, UPDATABLE)
        joining = times[:, None] * self.problem.kept.largest()
        regular = regular & no_smaller_than_rounding(rest, joining)
        found = np.empty((len(rest), self.problem.n))
        updated = np.flatnonzero(regular)
        for part in np.array_split(updated, 1 + len(updated) * self.problem.n // COSTS_AT_ONCE):
            found[part] = self._updated(rest[part], cov[part], times[part])
        for i in np.flatnonzero(~regular):
            found[i] = self.criterion.cost(rest[i] + times[i] * self.problem.blocks())
        return found

    def _updated(self, rest: Array, cov: Array, times: Array) -> Array:
        """Costs (k, n), where the inverses ``cov`` (k, p, p) are accurate."""
        r = times[:, None]
        D = self._entries(cov)
        if isinstance(self.criterion, DeterminantCriterion):
            log_det, _ = _eliminated(D, None, r)
            log_det += np.linalg.slogdet(rest).logabsdet[:, None]
            return self.criterion.cost_of_log_determinant(log_det, rest.shape[-1])
        assert self.slope is not None
        _, fall = _eliminated(D, self._entries(cov @ self.slope @ cov), r)
        left = np.tensordot(cov, self.slope, 2)[:, None] - fall
        # Rounding may take more than there is from the trace of a plan that is almost singular.
        return np.where(left > 0, left, np.inf) ** self.criterion.degree

    def _entries(self, C: Array) -> Array:
        """Upper triangles (k, s, n) of ``U_j C_i U_j'`` for symmetric C (k, p, p)."""
        i, j = triangle(C.shape[-1])
        flat = self.products.reshape(len(i), -1)
        return np.asarray((C[:, i, j] @ flat).reshape(len(C), *self.products.shape[1:]))


def _eliminated(S: Array, E: Array | None, r: Array) -> tuple[Array, Array]:
    """``log det D`` and ``r tr(D^-1 E)`` (k, n) for ``D = I + r S``, from triangles (k, s, n).

    Elimination makes D diagonal, and takes E along. No pivot is below one, so that no digits are
    lost; in determinants that are written out they are, where S is large and of low rank.

    Args:
        S: Upper triangles of positive semidefinite matrices, which are overwritten.
        E: Those of further ones, likewise; None for zero.
        r: Repetitions (k, 1).
    """
    size = round(np.sqrt(2 * S.shape[1] + 0.25) - 0.5)
    at = {pair: entry for entry, pair in enumerate(zip(*triangle(size), strict=True))}
    S *= r[:, None]
    for a in range(size):
        S[:, at[a, a]] += 1.0
    log_det = np.zeros((len(S), S.shape[2]))
    trace = np.zeros_like(log_det)
    for a in range(size):
        pivot = S[:, at[a, a]]
        if E is None:
            log_det += np.log(pivot)
        else:
            trace += E[:, at[a, a]] / pivot
        parts = {b: S[:, at[a, b]] / pivot for b in range(a + 1, size)}
        for b, c in at:
            if a < b:
                S[:, at[b, c]] -= parts[b] * S[:, at[a, c]]
                if E is not None:
                    across = E[:, at[a, c]] - parts[c] * E[:, at[a, a]]
                    E[:, at[b, c]] -= parts[b] * across + parts[c] * E[:, at[a, b]]
    return log_det, r * trace


@lru_cache(maxsize=8)
def _slope_of(criterion: Criterion, p: int) -> Array | None:
    """The slope, which is found once for the many exchanges of a search."""
    return constant_slope(criterion, np.eye(p))
