"""What the parameters of a fault and sizes of noise cost, when they are compared with others."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from criteria.linalg.inverse import TINY
from edtk.fit.distributions import log_normal_below
from edtk.fit.estimate_noise import Stratum
from edtk.system.typing import Array, Mask

# Student's distribution with so many degrees of freedom, of the usual width, is the one of a
# fault's size beforehand: mostly within a factor of two, rarely five times as large.
FREEDOM = 4.0
# Grids reach so many standard deviations of a logarithm, in steps of a fifth and a tenth of one.
REACH = 8.0


# It is a mixture of normal ones, whose widths are these factors of the usual one.
FACTORS = 2.0 ** np.arange(-2, 7)
WEIGHTS = FACTORS**-FREEDOM * np.exp(-FREEDOM / (2 * FACTORS**2))
WEIGHTS = WEIGHTS / WEIGHTS.sum()
SMALLER = 4.0 ** -np.arange(3)  # sizes of disturbed readings over that of mistyped ones


def rarity(
    c: Array, covariance: Array, usual: ArrayLike, only_positive: ArrayLike = False
) -> Array:
    """Twice the negative logarithms of the share of the likelihood that faults' sizes have.

    The likelihood of a size x is ``exp(-(x - c)' C^-1 (x - c) / 2)`` of its maximum. Its mean over
    normal sizes of covariance ``t^2 I`` is

        ``det(I + t^2 C^-1)^-1/2 exp(-c' (C + t^2 I)^-1 c / 2)``,

    and that over Student's distribution is the mean of these (Gelman and others, Bayesian Data
    Analysis, 3rd edition, sections 7.4 and 17.2). Of a fault that the measurements do not show, it
    is what the maximum of the likelihood gained; of one that they show well, about
    ``log det(t^2 C^-1)``, as with Bayes' information criterion. So a fault that explains a small
    misfit, but is usually so large that it would have made a large one, is less likely than one
    that is usually as small; and directions of a fault that measurements hardly show do not count
    against it.

    Args:
        c: Sizes of faults (..., dims) at the maximum of the likelihood, SI.
        covariance: Their covariances C (..., dims, dims).
        usual: Lengths (...) that such sizes usually have, in SI units.
        only_positive: Whether (...) a negative size is none; with one parameter.
    """
    return _mixed(_costs(c, covariance, np.asarray(usual), np.asarray(only_positive)))


def _mixed(cost: Array) -> Array:
    """Twice the negative logarithms (...) of the mean shares over Student's distribution."""
    least = cost.min(axis=-1, keepdims=True)
    return np.asarray(least[..., 0] - 2 * np.log(np.exp(-(cost - least) / 2) @ WEIGHTS))


def reading_rarity(c: Array, covariance: Array, usual: float) -> float:
    """The same of a single reading that is off: by about `usual`, or by much less.

    One that was mistyped is off by the size of all readings; a beam that was disturbed makes less,
    of any order of magnitude.
    """
    sizes = np.asarray(usual * SMALLER, dtype=np.float64)
    each = _mixed(_costs(c, covariance, sizes, np.array(False)))
    return float(-2 * (np.logaddexp.reduce(-each / 2) - math.log(len(each))))


def likely_size(c: Array, covariance: Array, usual: ArrayLike) -> tuple[Array, Array]:
    """Means (..., dims) and covariances (..., dims, dims) of faults' sizes, with what is usual.

    The maximum of the likelihood c is far off along directions that measurements hardly show; there
    the usual size tells more.

    Args:
        c: Sizes of faults (..., dims) at the maximum of the likelihood, SI.
        covariance: Their covariances C (..., dims, dims).
        usual: Lengths (...) that such sizes usually have, in SI units.
    """
    usual = np.asarray(usual)
    cost = _costs(c, covariance, usual, np.array(False))
    weights = WEIGHTS * np.exp(-(cost - cost.min(axis=-1, keepdims=True)) / 2)
    weights = (weights / weights.sum(axis=-1, keepdims=True))[..., None]
    values, vectors = np.linalg.eigh(covariance)
    t2 = _variances(usual, c.shape[-1])[..., None]
    kept = t2 / (np.maximum(values, 0.0)[..., None, :] + t2)
    means = (c[..., None, :] @ vectors) * kept
    mean = (weights * means).sum(axis=-2)
    off = means - mean[..., None, :]
    within = np.eye(c.shape[-1]) * (values * (weights * kept).sum(axis=-2))[..., None]
    spread = within + np.swapaxes(off, -1, -2) @ (off * weights)
    likely = (vectors @ mean[..., None])[..., 0]
    return likely, np.asarray(vectors @ spread @ np.swapaxes(vectors, -1, -2))


def _variances(usual: Array, dims: int) -> Array:
    """Variances (..., factors) of each parameter, such that its vector has the usual length."""
    return np.asarray((usual[..., None] * FACTORS) ** 2 / dims)


def _costs(c: Array, covariance: Array, usual: Array, only_positive: Mask) -> Array:
    """Twice the negative logarithms (..., factors) of the shares over normal sizes."""
    t2 = _variances(usual, c.shape[-1])[..., None]
    values, vectors = np.linalg.eigh(covariance)
    # Rounding may leave no variance at all, and then a quotient by it would overflow.
    values = np.maximum(values, np.finfo(float).tiny)[..., None, :]
    along = (c[..., None, :] @ vectors) ** 2
    cost = (along / (values + t2) + np.log(values + t2) - np.log(values)).sum(axis=-1)
    if only_positive.any():
        # The share of the likelihood over positive sizes, which have twice the density.
        z = (c[..., None, :] * np.sqrt(t2 / (values + t2)) / np.sqrt(values))[..., 0]
        above = 2 * (math.log(2) + log_normal_below(z))
        cost = cost - np.where(only_positive[..., None], above, 0.0)
    return np.asarray(cost)


USUAL_FACTOR = math.log(1.5)  # by which the true noise is off the stated one, as a logarithm
STEPS = np.linspace(-REACH, REACH, 81)
ABOVE = np.linspace(0.0, 2 * REACH, 161)


def noise_rarity(own: Stratum, shared: Sequence[tuple[Stratum, float]] = ()) -> float:
    """Twice the negative logarithm of the share of the likelihood that sizes of noise have.

    Residuals are split into parts of d degrees of freedom each, whose mean squares M are
    ``m chi^2_d / d``: one of the readings' own noise, with ``m = s^2``, and others in which n
    readings have noise in common, with ``m = s^2 + n t^2``. At ``m = M`` the likelihood is largest;
    elsewhere its share is

        ``exp(-d (M/m - 1 - log(M/m)) / 2)``.

    This is its mean where the logarithm of s has Student's distribution with four degrees of
    freedom about that of the stated noise, mostly within a factor of 1.5, and the part of a
    reading's variance that others share, ``t^2 / (s^2 + t^2)``, is anything from none to all alike.
    So little more than nothing is paid for what few degrees of freedom leave open, other than with
    Bayes' information criterion, which knows of no prior.

    Args:
        own: Squares, in units of the stated noise, that only the readings' own noise makes.
        shared: Those that shared noise makes too, each with its number n of readings.
    """
    log_s = math.log(max(own.mean_square, TINY)) / 2 + STEPS / math.sqrt(2 * own.dof)
    x = log_s / USUAL_FACTOR
    density = math.log(3 / 8 / USUAL_FACTOR) - 2.5 * np.log1p(x**2 / 4)
    share = density + _log_likelihood(own, 2 * log_s)
    for part, readings in shared:
        share = share + _with_common(part, readings, 2 * log_s)
    return -2 * float(np.logaddexp.reduce(share) + math.log(log_s[1] - log_s[0]))


def _with_common(part: Stratum, readings: float, log_own: Array) -> Array:
    """Logarithms (s,) of the mean shares of one part, for variances (s,) of readings by themselves.

    With the ratio ``r = m / s^2`` and a share of the variance that is anything alike, ``log r`` has
    the density ``n r / (r - 1 + n)^2``.
    """
    width = math.sqrt(2 / part.dof)
    best = math.log(max(part.mean_square, TINY))
    log_m = np.maximum(log_own, best - REACH * width)[:, None] + width * ABOVE
    log_r = log_m - log_own[:, None]
    more = log_r + np.log1p((readings - 1) * np.exp(-log_r))  # log(r - 1 + n)
    density = math.log(readings) + log_r - 2 * more
    each = density + _log_likelihood(part, log_m) + math.log(width * (ABOVE[1] - ABOVE[0]))
    each[:, 0] -= math.log(2)  # by the trapezoidal rule, as it may be the largest
    return np.asarray(np.logaddexp.reduce(each, axis=1))


def _log_likelihood(part: Stratum, log_m: Array) -> Array:
    """Logarithm of the likelihood of variances, over the largest one."""
    log_ratio = math.log(max(part.mean_square, TINY)) - log_m
    with np.errstate(over="ignore"):
        return np.asarray(-part.dof / 2 * (np.exp(log_ratio) - 1 - log_ratio))
