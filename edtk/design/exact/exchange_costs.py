"""Costs of a plan after each of many exchanges, without an inverse for each."""

import numpy as np

from criteria import Criterion, Interest
from criteria.determinant_criterion import DeterminantCriterion
from criteria.linalg.inverse import guarded_inverse
from criteria.linalg.log_determinant import log_determinant
from edtk.system.typing import Array, Mask

# The inverse of R is updated only where its least eigenvalue, at unit diagonal, is above this, and
# where no diagonal entry is below this share of the information that joins. A smaller entry may be
# the rounding of a zero: after the only pose that excites a parameter is taken out, R had 1e-20 of
# the other entries there, positive definite by chance, and its update was noise.
ACCURATE = 1e-6


def exchange_costs(
    criterion: Criterion, rest: Array, joined: Array, factors: Array, times: Array
) -> Array:
    """Compute the costs of ``R_i + r_i U_ij' U_ij``, by an update wherever it is accurate.

    ``det(R + r U' U) = det(R) det(I + r U R^-1 U')`` serves criteria of the determinant alone, and
    ``(R + r U' U)^-1 = R^-1 - R^-1 U' (I/r + U R^-1 U')^-1 U R^-1`` serves all others. Of a part of
    the parameters only their covariance is updated. Where R is nearly singular, the sum is formed
    and inverted itself.

    Args:
        criterion: The criterion.
        rest: Information R (k, p, p) of a plan without the measurements of one place.
        joined: Information ``U' U`` (k, n, p, p) of the candidates for that place.
        factors: Their factors U (k, n, rows, p).
        times: Repetitions r (k,) of the place.

    Returns:
        Costs (k, n).
    """
    _, cov, regular = guarded_inverse(rest, ACCURATE)
    largest = times[:, None] * np.diagonal(joined, axis1=-2, axis2=-1).max(axis=1)
    regular = regular & no_smaller_than_rounding(rest, largest)
    if regular.all():
        return _updated_costs(criterion, rest, cov, joined, factors, times)
    costs = np.empty(joined.shape[:2])
    direct = ~regular
    joining = times[direct, None, None, None] * joined[direct]
    costs[direct] = criterion.cost(rest[direct, None] + joining)
    if regular.any():
        arrays = (array[regular] for array in (rest, cov, joined, factors, times))
        costs[regular] = _updated_costs(criterion, *arrays)
    return costs


def no_smaller_than_rounding(rest: Array, joining: Array) -> Mask:
    """Whether each R (k,) has diagonal entries that rounding cannot have left.

    Args:
        rest: Information R (k, p, p).
        joining: The largest diagonal entries (k, p) of what may join it.
    """
    diagonal = np.diagonal(rest, axis1=-2, axis2=-1)
    return np.asarray((diagonal >= ACCURATE * joining).all(axis=1), dtype=bool)


def _updated_costs(
    criterion: Criterion, rest: Array, cov: Array, joined: Array, factors: Array, times: Array
) -> Array:
    """Costs (k, n) by the lemmas, where the inverses ``cov = R^-1`` (k, p, p) are accurate."""
    r = times[:, None, None, None]
    if isinstance(criterion, Interest) and isinstance(criterion.base, DeterminantCriterion):
        return _determinants_of_interest(criterion, criterion.base, cov, factors, r)
    W = factors @ cov[:, None]
    S = W @ np.swapaxes(factors, -1, -2)
    eye = np.eye(factors.shape[-2])
    if isinstance(criterion, DeterminantCriterion):
        log_det = np.linalg.slogdet(rest).logabsdet[:, None]
        return criterion.cost_of_log_determinant(
            log_det + np.linalg.slogdet(eye + r * S).logabsdet, rest.shape[-1]
        )
    if isinstance(criterion, Interest):
        told = criterion.side(W)
        fall = np.swapaxes(told, -1, -2) @ np.linalg.solve(eye / r + S, told)
        return criterion.cost_of_variance(criterion.variance(cov)[:, None] - fall)
    updated = cov[:, None] - np.swapaxes(W, -1, -2) @ np.linalg.solve(eye / r + S, W)
    return criterion.cost_of_regular(rest[:, None] + r * joined, updated)


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
