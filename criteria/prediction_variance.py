"""I-optimality: the mean variance of predictions over a region or a set."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from criteria.a_optimality import AOptimality
from criteria.errors import CriterionError
from criteria.linalg.inverse import ROUNDING, full_rank_root, rounding_of_rows
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
        root: In place of W or points: K (p, s) of full column rank, with ``W = K K'``. It has the
            digits that the squares in W have lost.

    Raises:
        CriterionError: Not exactly one of W, points and root is given, or it is not such an array.
    """

    name = "I"
    title = "Mean prediction variance"
    formula = "trace(W cov)"

    def __init__(
        self,
        W: ArrayLike | None = None,
        points: ArrayLike | None = None,
        weights: ArrayLike | None = None,
        root: ArrayLike | None = None,
    ) -> None:
        given = [key for key, x in (("W", W), ("points", points), ("root", root)) if x is not None]
        if len(given) != 1:
            raise CriterionError("criterion 'I' needs W or points or root; expected one of them")
        if weights is not None and points is None:
            raise CriterionError(
                f"criterion 'I': weights belong to points, and {given[0]} is given"
            )
        try:
            if W is not None:
                K = full_rank_root(W)
            else:
                K = _of_points(points, weights) if root is None else _of_root(root)
        except ValueError as error:
            raise CriterionError(f"criterion 'I': {given[0]}: {error}") from error
        K.flags.writeable = False
        self._fill(AOptimality(), K, ())
        self._of_squares = W is not None

    def _describe(self, base: Relaxable) -> None:
        """What W decides."""
        self.needs_all = self.K.shape[0] == self.K.shape[1]

    @property
    def label(self) -> str:
        """The name alone: W has no short form in words."""
        return self.name

    def rounding(self, W: Array) -> float:
        """That of the combinations together, and of W itself where its squares were given."""
        found = float(rounding_of_rows(self.K.T, W))
        if not self._of_squares:
            return found
        # Entries of W are roundings, and its root leaves out what may be nothing else.
        sizes = np.linalg.norm(self.K, axis=1) @ np.linalg.norm(W, axis=1)
        variance = float(np.square(self.K.T @ W).sum())
        return found + float(len(self.K) * ROUNDING * sizes**2 / variance)

    @property
    def arguments(self) -> dict[str, Any]:
        """K, to the last digit."""
        return {"root": self.K.tolist()}


def _of_root(root: ArrayLike) -> Array:
    """A copy of a root (p, s)."""
    K = np.array(root, dtype=float)
    if K.ndim != 2 or 0 in K.shape or not np.isfinite(K).all() or K.shape[1] > K.shape[0]:
        raise ValueError("expected a finite matrix (p, s) of full column rank")
    if not _are_independent(K):
        raise ValueError("expected columns that do not follow from each other")
    return K


def _are_independent(K: Array) -> bool:
    """Whether no column of K (p, s) follows from the others, in any units of rows and columns."""
    sizes = np.abs(K).max(axis=1, keepdims=True)
    even = K / np.where(sizes > 0, sizes, 1.0)
    lengths = np.linalg.norm(even, axis=0)
    return bool(lengths.all()) and np.linalg.matrix_rank(even / lengths) == K.shape[1]


def regressors(points: ArrayLike | None) -> Array:
    """The regressors (k, rows, p) of k places.

    Raises:
        ValueError: They are no such array, or zero.
    """
    try:
        X = np.asarray(points, dtype=float)
    except (TypeError, ValueError):
        X = np.empty(0)
    X = X[:, None, :] if X.ndim == 2 else X
    if X.ndim != 3 or 0 in X.shape or not np.isfinite(X).all() or not X.any():
        raise ValueError(
            "expected finite regressors (k, p) or (k, rows, p), not all zero: what the model's "
            "p parameters are multiplied with at k places"
        )
    return X


def _of_points(points: ArrayLike | None, weights: ArrayLike | None) -> Array:
    """K (p, s) with ``K K'`` the weighted mean of the places' X'X.

    It is the triangle of a QR decomposition of their rows, so that nothing is squared.
    """
    X = regressors(points)
    w = np.ones(len(X)) if weights is None else np.asarray(weights, dtype=float)
    if w.shape != X.shape[:1] or not (np.isfinite(w) & (w >= 0)).all() or not w.any():
        raise ValueError("expected a weight of each point, at least zero, not all of them zero")
    rows = (np.sqrt(w / w.sum())[:, None, None] * X).reshape(-1, X.shape[-1])
    R = np.asarray(np.linalg.qr(rows, mode="r"))
    length = np.linalg.norm(R, axis=0)
    if not length.any():
        raise ValueError("expected a weight for places whose regressors are not all zero")
    unit = np.where(length > 0, length, 1.0)
    _, s, V = np.linalg.svd(R / unit, full_matrices=False)
    told = s > len(unit) * ROUNDING * s[0]
    if told.sum() == len(unit):
        return np.array(R.T)
    return np.asarray((s[told, None] * V[told] * unit).T)
