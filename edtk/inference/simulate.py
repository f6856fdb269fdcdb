"""Measurements as the paper's Eq. (10) makes them."""

import numpy as np
from numpy.typing import ArrayLike

from edtk.inference.correlated_noise import CorrelatedNoise
from edtk.inference.whiten import AnyNoise
from edtk.system.typing import Array


def simulate(
    A: Array, k: ArrayLike, sigma: AnyNoise, rng: np.random.Generator, runs: int = 1
) -> Array:
    """Draw measurements of a plan, Eq. (10): ``dp_i = A_i k0 + eps_i`` with normal noise.

    Args:
        A: Regressors (m, rows, p), one a measurement [m/(rad/(N m))].
        k: True compliances k0 (p,) [rad/(N m)].
        sigma: Standard deviation of the noise, one number or one a row (rows,) [m, rad]; or
            correlated noise of the m measurements.
        rng: Source of randomness.
        runs: How many times the plan is carried out.

    Returns:
        Deflections (runs, m, rows) [m, rad], with errors that are independent but for
        what the noise correlates.
    """
    clean = A @ np.asarray(k, dtype=float)
    z = rng.standard_normal((runs, *clean.shape))
    if isinstance(sigma, CorrelatedNoise):
        return clean + sigma.colour(z)
    return clean + np.asarray(sigma) * z
