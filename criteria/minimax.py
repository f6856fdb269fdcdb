"""Minimax over several criteria or models: the design whose worst efficiency is the best."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from criteria.criterion import Criterion, KinkedCriterion
from criteria.linalg.logarithms import soft_maximum
from criteria.linalg.shares import least_squares_shares
from criteria.linalg.typing import Array
from criteria.registry import register
from criteria.relaxable import Formulation
from criteria.several_criteria import SeveralCriteria

if TYPE_CHECKING:
    import cvxpy as cp

SHARE_STEPS = 30  # towards the best shares of the criteria


@register
class Minimax(KinkedCriterion, SeveralCriteria):
    """``max_j f_j``, the largest loss of several criteria.

    With the best value of each, its inverse is the least efficiency, and the best design is the
    standardised maximin design (Dette 1997). A subgradient is that of a criterion whose loss is the
    largest, ``-f_j G_j`` with the slope ``G_j = -grad log f_j``. With parts Z_j of a multiplier,
    ``max_j q_j / y_j`` is least, of all ``sum y_j <= 1``, where the y_j are in the ratios of the
    q_j: the polar is at least ``sum q_j``.

    Args:
        criteria: See `SeveralCriteria`.
        best: See `SeveralCriteria`.
        sizes: See `SeveralCriteria`.

    Raises:
        CriterionError: An argument is not as described.
    """

    name = "minimax"
    title = "Largest loss"
    formula = "max_j (cost_j / best_j)^(1 / d_j)"

    def __init__(
        self,
        criteria: Sequence[Criterion | str | Mapping[str, Any]],
        best: ArrayLike | None = None,
        sizes: Sequence[int] | None = None,
    ) -> None:
        super().__init__()
        self._fill(criteria, best, sizes)

    def smoothed(self, sharpness: float) -> Self:
        """The same criterion with a soft maximum in place of the maximum."""
        other = self._copy()
        KinkedCriterion.__init__(other, sharpness)
        return other

    def largest_of(self, p: int) -> "Minimax | None":
        """Its losses, unless it is smoothed, or a part has no curvature in closed form."""
        return None if self.smooth or self.loss_curvatures(np.eye(p)) is None else self

    def polar(self, Z: Array, M: Array) -> float:
        """``sum q_j`` for parts of Z by the best shares that were found.

        At the optimum Z is ``sum u_j G_j`` with shares u of sum one on the largest losses alone,
        and ``q_j = u_j cost``. Hence non-negative least squares for the first shares, and the steps
        ``u ~ q``; the second choice is all of Z for the worst criterion.
        """
        return float(self.part_polars(Z, M, self.dual_weights(Z, M)).sum())

    def dual_weights(self, Z: Array, M: Array) -> Array:
        """The shares u (k,) of sum one that `polar` takes."""
        if self.models is not None:
            q = self.part_polars(Z, M, np.ones(len(self.parts)))
            return np.asarray(q / q.sum() if q.sum() > 0 else np.full(len(q), 1 / len(q)))
        if not self.needs_all:
            Q, N, regular = self._regular(M)
            return regular.dual_weights(Q.T @ Z @ Q, N)
        safe, cov, _ = self.inverse(M)
        losses = self.losses(safe, cov)
        starts = [
            self._least_squares_shares(Z, safe, cov, losses),
            np.eye(len(losses))[losses.argmax()],
        ]
        best = starts[-1]
        most = 0.0
        for shares in starts:
            for _ in range(SHARE_STEPS):
                q = self.part_polars(Z, M, shares)
                total = float(q.sum())
                if total > most:
                    most = total
                    best = shares
                if not total > 0 or np.abs(q / total - shares).max() < 1e-14:
                    break
                shares = q / total
        return best

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """The largest of the losses' own programs, each in the same unit."""
        import cvxpy as cp

        losses = []
        constraints = []
        for part, best in zip(self.parts, self.best, strict=True):
            size = float(best * unit**part.degree)
            objective, more = part.formulation(M, total, T, size)
            power = 1 / (part.expression_power * part.degree)
            losses.append(objective if power == 1 else cp.power(objective, power))
            constraints += more
        return cp.max(cp.hstack(losses)), constraints

    def _least_squares_shares(self, Z: Array, M: Array, cov: Array, losses: Array) -> Array:
        """Shares (k,) of sum one with ``sum u_j G_j`` nearly proportional to Z."""
        T = self.whitener(M)
        S = np.linalg.pinv(T)
        slopes = S @ self.slopes(M, cov) @ S.T
        # Parts that are far from the largest loss must not stand in for those that have it.
        found = least_squares_shares(slopes, S @ Z @ S.T, 1 - losses / losses.max())
        return found if found.any() else np.full(len(found), 1 / len(found))

    def _cost(self, M: Array, cov: Array) -> Array:
        return self.cost_of_losses(self.losses(M, cov))

    def _gradient(self, M: Array, cov: Array) -> Array:
        losses = self.losses(M, cov)
        _, slopes = soft_maximum(losses, self.sharpness)
        return -self.mixed_slope(slopes * losses, M, cov)

    def cost_of_losses(self, losses: Array) -> Array:
        """The largest, or its soft maximum."""
        return soft_maximum(losses, self.sharpness)[0]
