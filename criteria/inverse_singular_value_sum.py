"""O5, the sum of the inverse singular values."""

import numpy as np

from criteria.criterion import Array, Criterion
from criteria.registry import register


@register
class InverseSingularValueSum(Criterion):
    """``sum 1/s_i = trace M^(-1/2)`` (Table 1), s the singular values of the stacked A/sigma.

    Convex, since t^(-1/2) is operator convex. Gradient: ``-1/2 M^(-3/2)``.
    """

    name = "O5"
    title = "Sum of inverse singular values"
    formula = "sum 1/s_i"
    sense = "min"
    degree = 0.5

    def _cost(self, M: Array, cov: Array) -> Array:
        return np.sqrt(np.maximum(np.linalg.eigvalsh(cov), 0.0)).sum(axis=-1)

    def _gradient(self, M: Array, cov: Array) -> Array:
        c, V = np.linalg.eigh(cov)
        return -0.5 * (V * np.maximum(c, 0.0)[..., None, :] ** 1.5) @ np.swapaxes(V, -1, -2)
