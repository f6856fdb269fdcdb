"""I-optimality: the mean variance of predictions over a region or a set."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from criteria.a_optimality import AOptimality
from criteria.criterion_error import CriterionError
from criteria.interest import combinations_of
from criteria.linalg.full_rank_root import full_rank_root
from criteria.linalg.typing import Array
from criteria.named_interest import SumOfVariances
from criteria.registry import register
from criteria.relaxable import Relaxable


@register
class PredictionVariance(SumOfVariances):
    """``trace(W cov)``, where ``W = mean of X'X`` over the places X at which the model predicts.

    Also called V- or Q-optimality, and L-optimality for any W; integrated over a region, W is the
    matrix of the region's moments. With ``W = K K'`` it is the sum of the variances of K'k, so that
    a W of lower rank does not ask for what no prediction needs. The polar is
    ``(trace (K' Z K)^(1/2))^2``, attained at a multiple of ``W^(1/2) (W^(1/2) Z W^(1/2))^(-1/2)
    W^(1/2)`` for a regular W. Gradient: ``-cov W cov``.

    Args:
        W: Weight matrix (p, p), symmetric and positive semidefinite; or else
        points: Regressors of the places, (k, p) or (k, rows, p).
        weights: Weight of each place (k,), at least zero; by default all are equal. Only their
            ratios count.

    Raises:
        CriterionError: Neither or both of W and points are given, or they are not such arrays.
    """

    name = "I"
    title = "Mean prediction variance"
    formula = "trace(W cov)"

    def __init__(
        self,
        W: ArrayLike | None = None,
        points: ArrayLike | None = None,
        weights: ArrayLike | None = None,
    ) -> None:
        if (W is None) == (points is None):
            raise CriterionError("criterion 'I' needs W or points; expected one of them")
        if W is not None and weights is not None:
            raise CriterionError("criterion 'I': weights belong to points, and W is given")
        try:
            K = full_rank_root(_moments(points, weights) if W is None else W)
        except ValueError as error:
            what = "points" if W is None else "W"
            raise CriterionError(f"criterion 'I': {what}: {error}") from error
        self._fill(AOptimality(), combinations_of(K), ())

    def _describe(self, base: Relaxable) -> None:
        """What W decides."""
        self.needs_all = self.K.shape[0] == self.K.shape[1]

    @property
    def label(self) -> str:
        """The name alone: W has no short form in words."""
        return self.name

    @property
    def arguments(self) -> dict[str, Any]:
        """W, to rounding."""
        return {"W": (self.K @ self.K.T).tolist()}


def _moments(points: ArrayLike | None, weights: ArrayLike | None) -> Array:
    """Weighted mean (p, p) of the places' X'X."""
    X = np.asarray(points, dtype=float)
    X = X[:, None, :] if X.ndim == 2 else X
    if X.ndim != 3 or 0 in X.shape or not np.isfinite(X).all():
        raise ValueError("expected finite regressors (k, p) or (k, rows, p)")
    w = np.ones(len(X)) if weights is None else np.asarray(weights, dtype=float)
    if w.shape != X.shape[:1] or not (np.isfinite(w) & (w >= 0)).all() or not w.any():
        raise ValueError("expected a weight of each point, at least zero, not all of them zero")
    return np.einsum("k,kri,krj->ij", w / w.sum(), X, X)
