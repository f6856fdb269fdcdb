"""O3: the least singular value of the stacked regressor."""

from criteria.e_optimality import EOptimality
from criteria.power_criterion import PowerCriterion
from criteria.registry import register


@register
class MinimumSingularValue(PowerCriterion):
    """``s_p = sqrt(lambda_min(M))``, the root of E; s are the singular values of A/sigma.

    Table 1 prints "min"; the criterion is maximised, as is usual in the field.
    """

    name = "O3"
    title = "Minimum singular value"
    formula = "s_p"
    sense = "max"
    degree = 0.5
    smooth = False
    base_class = EOptimality
    exponent = 0.5
    expression_power = 2.0
