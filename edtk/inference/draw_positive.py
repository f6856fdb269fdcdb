"""Draws from a normal distribution that is confined to positive numbers."""

import numpy as np

from edtk.system.typing import Array

# Of two coordinates, a sweep multiplies the memory of the start by their squared correlation: at
# 0.98 less than 2 % of it remain.
SWEEPS = 100


def draw_positive(mean: Array, precision: Array, n: int, rng: np.random.Generator) -> Array:
    """Draw from where no tail is too far to be hit, by Gibbs sampling of one coordinate at a time.

    Given the others, coordinate i is normal about ``m_i - sum_j P_ij (x_j - m_j) / P_ii``, j other
    than i, with variance 1/P_ii, and confined to positive numbers.

    Args:
        mean: m (p,), any sign.
        precision: P (p, p); coordinates should be of like scale.
        n: Number of independent draws.
        rng: Source of randomness.

    Returns:
        Draws (n, p), all positive.
    """
    from scipy.stats import truncnorm

    x = np.tile(np.abs(mean), (n, 1))
    spread = 1 / np.sqrt(np.diag(precision))
    for _ in range(SWEEPS):
        for i in range(len(mean)):
            pull = (x - mean) @ precision[:, i] - (x[:, i] - mean[i]) * precision[i, i]
            centre = mean[i] - pull * spread[i] ** 2
            lower = -centre / spread[i]
            x[:, i] = truncnorm.rvs(lower, np.inf, centre, spread[i], random_state=rng)
    return x
