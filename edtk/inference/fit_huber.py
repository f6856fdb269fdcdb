"""Huber's estimate: squares for small residuals, absolute values for large ones."""

from dataclasses import dataclass

import numpy as np

from edtk.system.typing import Array

# In standard deviations of the noise: 95 % efficient for normal errors (Huber 1981).
CORNER = 1.345

# Median absolute value of a standard normal variable, inverted.
MAD_TO_STD = 1.4826

# Fit and scale in turn. Of 300 random fits half settled within 6 rounds and all but 7 within 14;
# those still changed after 20, by 0.3 % at most.
MOST_ROUNDS = 20
SCALE_TOLERANCE = 1e-6

# Residuals below this share of the largest measurement are rounding, and no noise.
ROUNDING = 1e-11


class SigmaTooSmallError(ValueError):
    """No residual is as small as the noise that is believed.

    Attributes:
        ratio: Smallest absolute residual over sigma.
    """

    def __init__(self, ratio: float) -> None:
        super().__init__(ratio)
        self.ratio = ratio

    def __str__(self) -> str:
        return f"the smallest residual is {self.ratio:.3g} times sigma: expected a larger sigma"


@dataclass(frozen=True, eq=False)
class HuberFit:
    """A robust fit.

    Attributes:
        x: Parameters (p,).
        scale: Standard deviation of the bulk of the residuals: 1.4826 times their median absolute
            value, times sqrt(N / (N - p)).
        inflation: The covariance of x is this times (X'X)^-1.
    """

    x: Array
    scale: float
    inflation: float


def fit_huber(X: Array, y: Array, start: Array, known: bool, least: float = -np.inf) -> HuberFit:
    """Fit parameters that a few gross errors do not spoil.

    Minimises ``sum rho(y - X x)`` with ``rho(r) = r^2/2`` for ``|r| <= c`` and ``c |r| - c^2/2``
    beyond. The covariance is that of an M-estimator of regression (Huber 1981, Section 7.6) with
    ``psi = rho'``: ``K^2 [sum psi^2 / (N - p)] / mean(psi')^2 (X'X)^-1`` with
    ``K = 1 + p/N (1 - mean psi') / mean psi'``. It holds for independent errors of one symmetric
    distribution, whose tails are taken from the residuals.

    Args:
        X: Columns (m, rows, p) of about unit length, in units of the noise.
        y: Measured (m, rows), in units of the noise; N = m rows > p.
        start: Where to begin (p,), the least-squares estimate.
        known: Whether the noise of y is of size one; else its size is estimated along with x.
        least: Lower bound of every parameter.

    Raises:
        SigmaTooSmallError: The size of the noise is known, and no residual is below the corner.
    """
    columns = X.reshape(-1, X.shape[-1])
    measured = y.ravel()
    p = columns.shape[1]
    x = np.maximum(start, least)
    scale = _scale(measured - columns @ x, p)
    for _ in range(1 if known else MOST_ROUNDS):
        size = 1.0 if known else scale
        if size <= ROUNDING * np.abs(measured).max():
            # Half of the residuals are rounding: the corner would be zero, and psi without a slope.
            return HuberFit(x, scale, 1.0 if known else scale**2)
        corner = CORNER * size
        x = _minimise(columns, measured, x, corner, least)
        before = scale
        scale = _scale(measured - columns @ x, p)
        if abs(scale - before) <= SCALE_TOLERANCE * before:
            break
    return HuberFit(x, scale, _inflation(measured - columns @ x, p, corner))


def _inflation(r: Array, p: int, corner: float) -> float:
    """The factor on (X'X)^-1 in the covariance, from residuals r (N,) of p parameters.

    Raises:
        SigmaTooSmallError: No residual is within the corner.
    """
    N = len(r)
    inside = float(np.mean(np.abs(r) <= corner))  # mean of psi'
    if not inside:
        raise SigmaTooSmallError(float(np.abs(r).min()))
    correction = 1 + p / N * (1 - inside) / inside
    spread = float((np.clip(r, -corner, corner) ** 2).sum()) / (N - p)
    return correction**2 * spread / inside**2


def _minimise(columns: Array, measured: Array, start: Array, corner: float, least: float) -> Array:
    """The parameters (p,) of the least loss; on the bound exactly where they are on it."""
    from scipy.optimize import least_squares

    size = max(float(np.abs(start).max()), corner)
    # SciPy's reflective trust region must begin inside the bounds, and ends inside them as well:
    # a parameter this near to the bound belongs on it.
    begin = start if np.isneginf(least) else np.maximum(start, least + 1e-6 * size)

    def residuals(x: Array) -> Array:
        return columns @ x - measured

    def jacobian(x: Array) -> Array:
        return columns

    found = least_squares(
        residuals,
        begin,
        jac=jacobian,
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
    return float(MAD_TO_STD * np.median(np.abs(r)) * np.sqrt(len(r) / (len(r) - p)))
