"""Compound criteria: one design for several purposes or models at once."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from criteria.criterion import Criterion
from criteria.curvature import Curvature
from criteria.errors import CriterionError
from criteria.linalg.typing import Array
from criteria.registry import register
from criteria.relaxable import Formulation, Relaxable
from criteria.several_criteria import SeveralCriteria

if TYPE_CHECKING:
    import cvxpy as cp


@register
class Compound(SeveralCriteria):
    """``prod_j f_j^(a_j)``, the weighted geometric mean of the losses of several criteria.

    Its inverse is the weighted geometric mean of the efficiencies (Atkinson, Donev and Tobias,
    Optimum Experimental Designs, chapter 21); best values only change its size, and not the best
    design. As ``-log f_j`` is concave, ``log cost`` is convex, and so is the cost. The gradient is
    ``-cost sum_j a_j G_j`` with the slopes ``G_j = -grad log f_j``. With parts Z_j of a multiplier,
    ``prod (q_j / y_j)^(a_j)`` is least, of all ``sum y_j <= 1``, at ``y_j = a_j``: the polar is at
    least ``prod (q_j / a_j)^(a_j)``.

    Args:
        criteria: See `SeveralCriteria`.
        weights: Weights a_j (k,), positive; their sum is brought to one. By default all are equal.
        best: See `SeveralCriteria`.
        sizes: See `SeveralCriteria`.

    Raises:
        CriterionError: An argument is not as described.
    """

    name = "compound"
    title = "Compound criterion"
    formula = "prod_j (cost_j / best_j)^(a_j / d_j)"

    def __init__(
        self,
        criteria: Sequence[Criterion | str | Mapping[str, Any]],
        weights: ArrayLike | None = None,
        best: ArrayLike | None = None,
        sizes: Sequence[int] | None = None,
    ) -> None:
        self._fill(criteria, best, sizes)
        a = np.ones(len(self.parts)) if weights is None else np.asarray(weights, dtype=float)
        if a.shape != (len(self.parts),) or not (np.isfinite(a) & (a > 0)).all():
            raise CriterionError(
                f"criterion 'compound': weights: expected a positive weight of each of "
                f"{len(self.parts)} criteria"
            )
        self.weights = a / a.sum()
        for part in self.parts:
            if not part.has_logarithm:
                raise CriterionError(
                    f"criterion 'compound': the logarithm of {part.label!r} has no convex form; "
                    "expected D, A, O1, rho0, I, c, Ds or phi"
                )

    def _take(self, parts: Sequence[Relaxable]) -> None:
        """Set the criteria; of several matrices together they know what all of them do."""
        super()._take(parts)
        self.batched_curvature = all(part.batched_curvature for part in parts)

    @property
    def arguments(self) -> dict[str, Any]:
        """What the constructor took."""
        return {**super().arguments, "weights": self.weights.tolist()}

    def curvatures(self, R: Array) -> tuple[Curvature, ...]:
        """Those of the losses, times their weights: log cost is the sum of their logs."""
        terms = self.loss_curvatures(R) or ()
        return tuple(term.power(float(a)) for term, a in zip(terms, self.weights, strict=False))

    def polar(self, Z: Array, M: Array) -> float:
        """``prod (q_j / a_j)^(a_j)``."""
        q = self.part_polars(Z, M, self.weights)
        return float(np.prod((q / self.weights) ** self.weights))

    def formulation(
        self, M: "cp.Expression", total: "cp.Expression", T: Array, unit: float
    ) -> Formulation:
        """``exp(-sum a_j l_j)`` with concave ``l_j <= -log(f_j / unit)``."""
        import cvxpy as cp

        sizes = self.best * unit ** np.array([part.degree for part in self.parts])
        found = [
            part.log_information(M, T, float(size))
            for part, size in zip(self.parts, sizes, strict=True)
        ]
        mean = sum(a * log for a, (log, _) in zip(self.weights, found, strict=True))
        return cp.exp(-mean), [*(each for _, more in found for each in more), total == 1]

    def cost_of_losses(self, losses: Array) -> Array:
        """The weighted geometric mean."""
        return np.asarray(np.exp(np.log(losses) @ self.weights))

    def _cost(self, M: Array, cov: Array) -> Array:
        return self.cost_of_losses(self.losses(M, cov))

    def _gradient(self, M: Array, cov: Array) -> Array:
        return -self._cost(M, cov)[..., None, None] * self.mixed_slope(self.weights, M, cov)
