"""O4, the noise amplification index."""

import numpy as np

from criteria.criterion import Array, Criterion
from criteria.registry import register


@register
class NoiseAmplification(Criterion):
    """``s_p^2 / s_1`` (Table 1), s the singular values of the stacked A/sigma.

    Neither convex nor monotone: information in the strongest direction lowers it. The cost is
    ``f = sqrt(lambda_1) / lambda_p`` with gradient ``f (v_1 v_1'/(2 lambda_1) - v_p v_p'/lambda_p)``.
    """

    name = "O4"
    title = "Noise amplification index"
    formula = "s_p^2 / s_1"
    sense = "max"
    degree = 0.5
    convex = False
    smooth = False
    monotone = False

    def _cost(self, M: Array, cov: Array) -> Array:
        return np.sqrt(np.linalg.eigvalsh(M)[..., -1]) * np.linalg.eigvalsh(cov)[..., -1]

    def _gradient(self, M: Array, cov: Array) -> Array:
        m, V = np.linalg.eigh(M)
        c, U = np.linalg.eigh(cov)
        v, u = V[..., -1:], U[..., -1:]
        G = 0.5 * v @ np.swapaxes(v, -1, -2) / m[..., -1, None, None]
        G = G - u @ np.swapaxes(u, -1, -2) * c[..., -1, None, None]
        return (np.sqrt(m[..., -1]) * c[..., -1])[..., None, None] * G
