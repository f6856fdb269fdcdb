"""G-optimality of predictions: the largest variance of a prediction over a set of places."""

from typing import Any, Self

from numpy.typing import ArrayLike

from criteria.errors import CriterionError
from criteria.power_criterion import PowerCriterion
from criteria.prediction_variance import regressors
from criteria.registry import register
from criteria.worst_task_accuracy import WorstTaskAccuracy


@register
class PredictionGOptimality(PowerCriterion):
    """``max_i trace(X_i cov X_i')``: the largest variance of a prediction over places X_i.

    This is G-optimality as the literature has it; the criterion "G" here is that of the paper, the
    largest variance of a parameter. It is the square of rho_max whose tasks are the places. If the
    places are the candidates, with one row each, it has the optimum of D, where it is p
    (Kiefer and Wolfowitz 1960).

    Args:
        points: Regressors of the places, (k, p) or (k, rows, p), finite and not all zero.

    Raises:
        CriterionError: The points are not such regressors.
    """

    name = "prediction_G"
    title = "G-optimality of predictions"
    formula = "max_i trace(X_i cov X_i')"
    sense = "min"
    degree = 1.0
    smooth = False
    unit_free = True
    needs_parameters = True
    takes_interest = False
    base_class = WorstTaskAccuracy
    exponent = 2.0
    expression_power = 1.0

    def __init__(self, points: ArrayLike) -> None:
        try:
            X = regressors(points)
        except ValueError as error:
            raise CriterionError(f"criterion 'prediction_G': points: {error}") from error
        super().__init__(WorstTaskAccuracy(X))

    @property
    def arguments(self) -> dict[str, Any]:
        """The places."""
        assert isinstance(self.base, WorstTaskAccuracy)
        return {"points": self.base.targets.tolist()}

    def _like(self, base: WorstTaskAccuracy) -> Self:  # type: ignore[override]
        other = type(self).__new__(type(self))
        PowerCriterion.__init__(other, base)
        return other
