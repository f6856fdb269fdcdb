"""Huber's estimate: squares for small residuals, absolute values for large ones."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

Array = NDArray[np.float64]
CORNER = 1.345  # in standard deviations: 95 % efficient for normal noise


class SigmaTooSmallError(ValueError):
    """No residual is as small as the noise that is believed."""


@dataclass(frozen=True, eq=False)
class HuberFit:
    """A robust fit.

    Attributes:
        x: Parameters (p,).
        scale: Standard deviation of the bulk of the residuals, 1.4826 times their median absolute value, times
            sqrt(N / (N - p)).
        inflation: The covariance of x is this times (X'X)^-1.
    """

    x: Array
    scale: float
    inflation: float


def fit_huber(X: Array, y: Array, start: Array, known: bool, least: float = -np.inf) -> HuberFit:
    """Minimise ``sum rho(y - X x)``: ``rho(r) = r^2/2`` for ``|r| <= c``, ``c |r| - c^2/2`` beyond.

    The covariance is that of an M-estimator of regression (Huber 1981, Section 7.6) with ``psi = rho'``:
    ``K^2 [sum psi^2 / (N - p)] / mean(psi')^2 (X'X)^-1`` with ``K = 1 + p/N (1 - mean psi') / mean psi'``. It
    holds for independent errors of one symmetric distribution, whose tails it takes from the residuals.

    Args:
        X: Columns (m, rows, p) of about unit length, in units of the noise.
        y: Measured (m, rows), in units of the noise; N = m rows > p.
        start: Where to begin (p,), the least-squares estimate.
        known: Whether the noise of y is of size one; else its size is estimated along with x.
        least: Lower bound of every parameter.

    Raises:
        SigmaTooSmallError: The size of the noise is known, and no residual is below the corner.
    """
    columns, measured = X.reshape(-1, X.shape[-1]), y.ravel()
    N, p = columns.shape
    x = np.maximum(start, least)
    scale = _scale(measured - columns @ x, p)
    for _ in range(1 if known else 20):
        size = 1.0 if known else scale
        if (
            size <= 1e-11 * np.abs(measured).max()
        ):  # half of the residuals are rounding: nothing to be robust against
            return HuberFit(x, scale, 1.0 if known else scale**2)
        corner = CORNER * size
        x = _minimise(columns, measured, x, corner, least)
        before, scale = scale, _scale(measured - columns @ x, p)
        if abs(scale - before) <= 1e-6 * before:
            break
    r = measured - columns @ x
    inside = float(np.mean(np.abs(r) <= corner))
    if not inside:
        raise SigmaTooSmallError(
            f"the smallest residual is {np.abs(r).min():.3g} times sigma: expected a larger sigma, or --sigma-unknown"
        )
    correction = 1 + p / N * (1 - inside) / inside
    spread = float((np.clip(r, -corner, corner) ** 2).sum()) / (N - p)
    return HuberFit(x, scale, correction**2 * spread / inside**2)


def _minimise(columns: Array, measured: Array, start: Array, corner: float, least: float) -> Array:
    """The parameters of the least loss; on the bound exactly where they are on it."""
    size = max(float(np.abs(start).max()), corner)
    begin = start if np.isneginf(least) else np.maximum(start, least + 1e-6 * size)
    found = least_squares(
        lambda x: columns @ x - measured,
        begin,
        jac=lambda x: columns,
        bounds=(least, np.inf),
        loss="huber",
        f_scale=corner,
        x_scale=size,
        xtol=1e-12,
        ftol=1e-14,
        gtol=1e-12,
        max_nfev=1000,
    )
    return np.where(found.x - least <= 1e-8 * size, least, found.x)


def _scale(r: Array, p: int) -> float:
    """Standard deviation of the bulk of residuals r (N,) of a fit of p parameters."""
    return float(1.4826 * np.median(np.abs(r)) * np.sqrt(len(r) / (len(r) - p)))
