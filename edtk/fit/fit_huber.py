"""Huber's estimate: squares for small residuals, absolute values for large ones."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from criteria.linalg.inverse import eigenpairs
from edtk.system.typing import Array

# In standard deviations of the noise: 95 % efficient for normal errors (Huber 1981).
CORNER = 1.345
# Median absolute value of a standard normal variable, inverted.
MAD_TO_STD = 1.4826
# Residuals below this share of the largest measurement are rounding, and no noise.
NO_NOISE = 1e-11


@dataclass(frozen=True)
class HuberSteps:
    """How Huber's estimate is found: fit and scale in turn."""

    # Fit and scale in turn. Of 300 random fits half settled within 6 rounds and all but 7 within
    # 14; those still changed after 20, by 0.3 % at most.
    rounds: int = 20
    tolerance: float = 1e-6
    # Steps of one fit: half a dozen is the rule, more where few residuals are within the corner.
    most_steps: int = 1000
    step_tolerance: float = 1e-9  # of the corner, in orthonormal coordinates
    step_rounding: float = 1e-14  # of the parameters, in orthonormal coordinates
    loss_rounding: float = 1e-13  # of the loss, a sum over all rows
    singular: float = 1e-9  # least eigenvalue of a curvature up to which Newton's step is not taken
    block: int = 2**14  # rows at a time


HUBER = HuberSteps()


class SigmaTooSmallError(ValueError):
    """No residual is as small as the noise that is believed."""


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


def fit_huber(
    Q: Array, R: Array, y: Array, start: Array, known: bool, least: float = -np.inf
) -> HuberFit:
    """Fit parameters that a few gross errors do not spoil.

    Minimises ``sum rho(y - X x)``, ``X = Q R``, with ``rho(r) = r^2/2`` for ``|r| <= c`` and
    ``c |r| - c^2/2`` beyond. The covariance is that of an M-estimator of regression (Huber 1981,
    Section 7.6) with ``psi = rho'``: ``K^2 [sum psi^2 / (N - p)] / mean(psi')^2 (X'X)^-1`` with
    ``K = 1 + p/N (1 - mean psi') / mean psi'``. It holds for independent errors of one symmetric
    distribution, whose tails are taken from the residuals.

    Args:
        Q: Orthonormal columns (m, rows, p).
        R: Upper triangle (p, p), which makes the columns X of about unit length, in units of the
            noise.
        y: Measured (m, rows), in units of the noise; N = m rows > p.
        start: Where to begin (p,), the least-squares estimate.
        known: Whether the noise of y is of size one; else its size is estimated along with x.
        least: Lower bound of every parameter.

    Raises:
        SigmaTooSmallError: The size of the noise is known, and no residual is below the corner.
    """
    data = _Data(Q.reshape(-1, len(R)), R, y.ravel())
    p = len(R)
    x = np.maximum(start, least)
    scale = _scale(data.residuals(x), p)
    for _ in range(1 if known else HUBER.rounds):
        size = 1.0 if known else scale
        if size <= NO_NOISE * np.abs(data.y).max():
            # Half of the residuals are rounding: the corner would be zero, and psi without a slope.
            return HuberFit(x, scale, 1.0 if known else scale**2)
        corner = CORNER * size
        x = _minimise(data, x, corner, least)
        residuals = data.residuals(x)
        before = scale
        scale = _scale(residuals, p)
        if abs(scale - before) <= HUBER.tolerance * before:
            break
    return HuberFit(x, scale, _inflation(residuals, p, corner))


def huber_weights(z: Array, scale: float) -> Array:
    """Weights of residuals z, of noise of size `scale`, by which least squares has the same fit."""
    corner = CORNER * scale
    return np.asarray(corner / np.maximum(np.abs(z), corner))


@dataclass(frozen=True, eq=False)
class _Data:
    """Columns ``X = Q R`` and what is to be fitted with them.

    Attributes:
        Q: Orthonormal columns (N, p).
        R: Upper triangle (p, p).
        y: Measured (N,).
    """

    Q: Array
    R: Array
    y: Array

    def residuals(self, x: Array) -> Array:
        """Residuals ``y - X x`` (N,)."""
        return self.y - self.Q @ (self.R @ x)

    def blocks(self) -> Iterator[tuple[Array, Array]]:
        """Q and y, so many rows at a time that their residuals stay in the cache."""
        for first in range(0, len(self.y), HUBER.block):
            rows = slice(first, first + HUBER.block)
            yield self.Q[rows], self.y[rows]


@dataclass(frozen=True, eq=False)
class _Local:
    """The loss about some parameters, in the orthonormal coordinates ``z = R x``.

    Attributes:
        loss: ``sum rho(r)``.
        slope: ``Q' psi(r)`` (p,), the direction in which the loss falls.
        curvature: ``sum psi'(r) Q Q'`` (p, p).
    """

    loss: float
    slope: Array
    curvature: Array


def _minimise(data: _Data, start: Array, corner: float, least: float) -> Array:
    """The parameters (p,) of the least loss; on the bound exactly where they are on it.

    The loss is quadratic but for residuals that cross the corner, so that Newton's method ends
    after a few steps, exactly. A step that does not lower the loss is replaced by one of
    reweighted least squares, which always does: its quadratic lies above the loss.
    """
    x = start
    here = _local(data, x, corner)
    for _ in range(HUBER.most_steps):
        lower = _lowered(data, x, here, here.curvature, corner, least)
        if lower is None:
            majorant = _majorant(data, x, corner)
            lower = _lowered(data, x, here, majorant, corner, least)
        if lower is None:
            return x
        before = x
        x, here = lower
        if _settled(data.R, before, x, corner):
            return x
    return x


def _lowered(
    data: _Data, x: Array, here: _Local, curvature: Array, corner: float, least: float
) -> tuple[Array, _Local] | None:
    """The minimiser (p,) of a quadratic about x, and the loss there; None if that is not lower."""
    moved = _stepped(data.R, x, here.slope, curvature, least)
    if moved is None:
        return None
    there = _local(data, moved, corner)
    # Near the minimum a step may lower the loss by less than the rounding of its sum.
    return (moved, there) if there.loss <= here.loss * (1 + HUBER.loss_rounding) else None


def _settled(R: Array, x: Array, moved: Array, corner: float) -> bool:
    """Whether a step is rounding: in orthonormal coordinates noise has the size of the corner."""
    step = np.abs(R @ (moved - x)).max()
    return bool(step <= HUBER.step_tolerance * corner + HUBER.step_rounding * np.abs(R @ x).max())


def _local(data: _Data, x: Array, corner: float) -> _Local:
    """Loss, slope and curvature about some parameters, in one pass over the rows."""
    z = data.R @ x
    loss = 0.0
    slope = np.zeros(len(z))
    curvature = np.eye(len(z))
    for Q, y in data.blocks():
        r = y - Q @ z
        psi = np.clip(r, -corner, corner)
        loss += float(psi @ (r - 0.5 * psi))
        slope += psi @ Q
        # Few residuals are beyond the corner: their share is subtracted from Q'Q = I.
        beyond = Q[np.abs(r) > corner]
        curvature -= beyond.T @ beyond
    return _Local(loss, slope, curvature)


def _majorant(data: _Data, x: Array, corner: float) -> Array:
    """``Q' diag(psi(r)/r) Q`` (p, p): the quadratic of reweighted least squares."""
    z = data.R @ x
    total = np.zeros((len(z), len(z)))
    for Q, y in data.blocks():
        weight = huber_weights(y - Q @ z, corner / CORNER)
        total += Q.T @ (Q * weight[:, None])
    return total


def _stepped(R: Array, x: Array, slope: Array, curvature: Array, least: float) -> Array | None:
    """The minimiser (p,) above the bound of a quadratic about x; None where it has none."""
    w, V = eigenpairs(curvature)
    if w[0] <= HUBER.singular:
        return None
    if np.isneginf(least):
        return x + np.linalg.solve(R, V @ ((slope @ V) / w))
    from scipy.optimize import nnls

    # |C R (x' - x) - C^-1 slope| with C = sqrt(w) V' is the quadratic, but for a constant.
    root = np.sqrt(w)
    C = root[:, None] * V.T @ R
    return least + nnls(C, C @ (x - least) + (slope @ V) / root)[0]


def _inflation(r: Array, p: int, corner: float) -> float:
    """The factor on (X'X)^-1 in the covariance, from residuals r (N,) of p parameters.

    Raises:
        SigmaTooSmallError: No residual is within the corner.
    """
    N = len(r)
    inside = float(np.mean(np.abs(r) <= corner))  # mean of psi'
    if not inside:
        ratio = np.abs(r).min()
        raise SigmaTooSmallError(
            f"the smallest residual is {ratio:.3g} times sigma: expected a larger sigma"
        )
    correction = 1 + p / N * (1 - inside) / inside
    spread = float((np.clip(r, -corner, corner) ** 2).sum()) / (N - p)
    return correction**2 * spread / inside**2


def _scale(r: Array, p: int) -> float:
    """Standard deviation of the bulk of residuals r (N,) of a fit of p parameters."""
    return float(MAD_TO_STD * np.median(np.abs(r)) * np.sqrt(len(r) / (len(r) - p)))
