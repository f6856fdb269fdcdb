"""O1: the geometric mean of the singular values of the stacked regressor."""

import numpy as np

from criteria.criterion import DeterminantCriterion
from criteria.d_optimality import DOptimality
from criteria.linalg.typing import Array
from criteria.power_criterion import PowerCriterion
from criteria.registry import register


@register
class SingularValueProduct(DeterminantCriterion, PowerCriterion):
    """``(s_1 ... s_p)^(1/p)`` (Table 1), the root of D; s are the singular values of A/sigma."""

    name = "O1"
    title = "Product of singular values"
    formula = "(s_1 ... s_p)^(1/p)"
    sense = "max"
    degree = 0.5
    unit_free = True
    base_class = DOptimality
    exponent = 0.5
    expression_power = 2.0

    def cost_of_log_determinant(self, log_det: Array, p: int) -> Array:
        """``exp(-log det(M) / 2p)``."""
        return np.asarray(np.exp(-self.exponent * log_det / p))
