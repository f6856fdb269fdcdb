"""O2, the condition number."""

import numpy as np

from criteria.criterion import Array, Criterion
from criteria.registry import register


@register
class ConditionNumber(Criterion):
    """``s_1 / s_p = sqrt(lambda_max(M) lambda_max(cov))`` (Table 1), s the singular values of the stacked A/sigma.

    Blind to the amount of information (degree 0), neither convex (only quasiconvex) nor monotone: a further
    experiment can make it worse. With unit eigenvectors v of the extreme eigenvalues the gradient is
    ``cost/2 (v_1 v_1'/lambda_1 - v_p v_p'/lambda_p)``.
    """

    name = "O2"
    title = "Condition number"
    formula = "s_1 / s_p"
    sense = "min"
    degree = 0.0
    convex = False
    smooth = False
    monotone = False

    def _cost(self, M: Array, cov: Array) -> Array:
        return np.sqrt(np.linalg.eigvalsh(M)[..., -1] * np.linalg.eigvalsh(cov)[..., -1])

    def _gradient(self, M: Array, cov: Array) -> Array:
        m, V = np.linalg.eigh(M)
        c, U = np.linalg.eigh(cov)
        v, u = V[..., -1:], U[..., -1:]
        G = v @ np.swapaxes(v, -1, -2) / m[..., -1, None, None]
        G = G - u @ np.swapaxes(u, -1, -2) * c[..., -1, None, None]
        return 0.5 * np.sqrt(m[..., -1] * c[..., -1])[..., None, None] * G
