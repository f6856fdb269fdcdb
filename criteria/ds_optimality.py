"""Ds-optimality: the volume of the confidence ellipsoid of some of the parameters."""

from typing import Any

from numpy.typing import ArrayLike

from criteria.d_optimality import DOptimality
from criteria.interest import combinations_of
from criteria.named_interest import NamedInterest
from criteria.registry import register


@register
class DsOptimality(NamedInterest):
    """``det(K' M^- K)^(-1/s)``, D-optimality for s combinations K'k; the others are nuisance.

    For parameters that K chooses it is ``(det M / det M_22)^(1/s)``, where M_22 is of the others.
    Known as D_A-optimality for general K. The polar is ``s det(K' Z K)^(1/s)``.

    Args:
        interest: Combinations K (p, s), one a column, of full column rank; (p,) for a single one.

    Raises:
        CriterionError: K is not such a matrix.
    """

    name = "Ds"
    title = "Ds-optimality"
    formula = "det(K' M^- K)^(-1/s)"
    sense = "max"
    degree = 1.0

    def __init__(self, interest: ArrayLike) -> None:
        self._fill(DOptimality(), combinations_of(interest), None)

    @property
    def arguments(self) -> dict[str, Any]:
        """The combinations."""
        return {"interest": self.K.tolist()}
