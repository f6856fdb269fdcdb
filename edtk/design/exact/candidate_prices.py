"""Costs of a plan after its exchanges for each of all candidates, by a few matrix products."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from criteria import Criterion
from criteria.determinant_criterion import DeterminantCriterion
from criteria.linalg.inverse import guarded_inverse
from criteria.linalg.triangle import triangle
from edtk.design.exact.constant_slope import constant_slope
from edtk.design.exact.exchange_costs import ACCURATE, no_smaller_than_rounding
from edtk.design.problem import Problem
from edtk.system.typing import Array

MOST_ROWS = 6  # of a candidate: the elimination of many is a loop over pairs of rows
MOST_ENTRIES = 2**19  # of all candidates' information: of more, only the most sensitive are tried
COSTS_AT_ONCE = 20_000  # their triangles, of a megabyte, stay in a core's cache


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
        _, cov, regular = guarded_inverse(rest, ACCURATE)
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
