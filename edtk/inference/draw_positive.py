"""Draws from a normal distribution that is confined to positive numbers."""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import truncnorm

Array = NDArray[np.float64]
SWEEPS = 100


def draw_positive(mean: Array, precision: Array, n: int, rng: np.random.Generator) -> Array:
    """Draws (n, p) by Gibbs sampling, one coordinate after the other, from where no tail is too far to be hit.

    Given the others a coordinate is normal about ``m_i - sum_j P_ij (x_j - m_j) / P_ii``, j other than i, with variance
    1/P_ii, and confined.

    Args:
        mean: m (p,), any sign.
        precision: P (p, p); coordinates should be of like scale.
        n: Number of independent draws.
        rng: Source of randomness.
    """
    x = np.tile(np.abs(mean), (n, 1))
    spread = 1 / np.sqrt(np.diag(precision))
    for _ in range(SWEEPS):
        for i in range(len(mean)):
            pull = (x - mean) @ precision[:, i] - (x[:, i] - mean[i]) * precision[i, i]
            about = mean[i] - pull * spread[i] ** 2
            x[:, i] = truncnorm.rvs(-about / spread[i], np.inf, about, spread[i], random_state=rng)
    return x
