"""c-optimality: the variance of one combination of the parameters."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from criteria.a_optimality import AOptimality
from criteria.errors import CriterionError
from criteria.interest import combinations_of
from criteria.named_interest import SumOfVariances
from criteria.registry import register

LONG = 30  # characters of a combination beyond which it is left out of the label


@register
class COptimality(SumOfVariances):
    """``c' cov c``, the variance of c'k: of a prediction, a contrast or a turning point.

    It is finite for a singular M too, as long as c'k is estimable, and the best designs often are
    singular (Elfving 1952). The polar is ``c' Z c``. Gradient: ``-(cov c)(cov c)'``.

    Args:
        c: The factors (p,), finite and not all zero.

    Raises:
        CriterionError: c is not such a vector.
    """

    name = "c"
    title = "c-optimality"
    formula = "c' cov c"

    def __init__(self, c: ArrayLike) -> None:
        factors = np.asarray(c, dtype=float)
        if factors.ndim != 1 or not np.isfinite(factors).all() or not factors.any():
            raise CriterionError(
                "criterion 'c': expected a vector (p,) of finite factors, not all zero"
            )
        self._fill(AOptimality(), combinations_of(factors), None)

    @property
    def label(self) -> str:
        """Such as "c of k1 - k2"; the name alone where that would be long."""
        (words,) = self.names
        return super().label if len(words) <= LONG else self.name

    @property
    def arguments(self) -> dict[str, Any]:
        """The factors."""
        return {"c": self.K[:, 0].tolist()}
