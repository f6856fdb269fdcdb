"""Measured rows in units of their noise, whether it is correlated or not."""

import numpy as np
from numpy.typing import ArrayLike

from edtk.inference.correlated_noise import CorrelatedNoise
from edtk.system.typing import Array

# Standard deviations (m, rows), or covariances of groups of measurements.
RowNoise = Array | CorrelatedNoise
# The same where one number, or one for each row, will do.
AnyNoise = ArrayLike | CorrelatedNoise


def whiten(x: Array, noise: AnyNoise) -> Array:
    """Make errors of measured rows independent and of size one.

    Args:
        x: Deflections or residuals (..., m, rows) [m, rad].
        noise: Standard deviations that broadcast to (m, rows), or correlated noise.

    Returns:
        ``x / sigma``, or ``W x`` where noise is correlated.
    """
    if isinstance(noise, CorrelatedNoise):
        return noise.whiten(x)
    return np.asarray(x / np.asarray(noise, dtype=float))


def whiten_columns(A: Array, noise: AnyNoise) -> Array:
    """The same for each column of regressors (m, rows, p)."""
    if isinstance(noise, CorrelatedNoise):
        return np.moveaxis(noise.whiten(np.moveaxis(A, -1, 0)), 0, -1)
    sigma = np.broadcast_to(np.asarray(noise, dtype=float), A.shape[:2])
    return np.asarray(A / sigma[..., None])


def numbers_of(noise: AnyNoise) -> list[Array]:
    """All numbers that a noise has, by which it is told from another one."""
    if isinstance(noise, CorrelatedNoise):
        members = [block.members.astype(float) for block in noise.blocks]
        return [*members, *(block.covariance for block in noise.blocks)]
    return [np.asarray(noise)]


def std_of(noise: AnyNoise) -> Array:
    """Standard deviations of single coordinates [m, rad]."""
    return noise.std if isinstance(noise, CorrelatedNoise) else np.asarray(noise, dtype=float)
