"""Measurements as the paper's Eq. (10) makes them."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def simulate(
    A: Array, k: ArrayLike, sigma: ArrayLike, rng: np.random.Generator, runs: int = 1
) -> Array:
    """Eq. (10): ``dp_i = A_i k0 + eps_i`` with independent normal noise.

    Args:
        A: Regressors (m, rows, p), one per measurement.
        k: True compliances (p,) [rad/(N m)].
        sigma: Standard deviation of the noise, one number or one per row (rows,) [m, rad].
        rng: Source of randomness.
        runs: How many times the plan is carried out.

    Returns:
        Deflections (runs, m, rows) [m, rad].
    """
    clean = A @ np.asarray(k, dtype=float)
    return clean + np.asarray(sigma) * rng.standard_normal((runs, *clean.shape))
