"""What the sizes of noise cost, when noise is compared with faults."""

import math
from collections.abc import Sequence

import numpy as np

from edtk.inference.error_strata import Stratum
from edtk.system.typing import Array

USUAL_FACTOR = math.log(1.5)  # by which the true noise is off the stated one, as a logarithm
# Grids reach so many standard deviations of a logarithm, in steps of a fifth and a tenth of one.
REACH = 8.0
STEPS = np.linspace(-REACH, REACH, 81)
ABOVE = np.linspace(0.0, 2 * REACH, 161)
LEAST = 1e-300  # mean square of nothing


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
    log_s = math.log(max(own.mean_square, LEAST)) / 2 + STEPS / math.sqrt(2 * own.dof)
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
    best = math.log(max(part.mean_square, LEAST))
    log_m = np.maximum(log_own, best - REACH * width)[:, None] + width * ABOVE
    log_r = log_m - log_own[:, None]
    more = log_r + np.log1p((readings - 1) * np.exp(-log_r))  # log(r - 1 + n)
    density = math.log(readings) + log_r - 2 * more
    each = density + _log_likelihood(part, log_m) + math.log(width * (ABOVE[1] - ABOVE[0]))
    each[:, 0] -= math.log(2)  # by the trapezoidal rule, as it may be the largest
    return np.asarray(np.logaddexp.reduce(each, axis=1))


def _log_likelihood(part: Stratum, log_m: Array) -> Array:
    """Logarithm of the likelihood of variances, over the largest one."""
    log_ratio = math.log(max(part.mean_square, LEAST)) - log_m
    with np.errstate(over="ignore"):
        return np.asarray(-part.dof / 2 * (np.exp(log_ratio) - 1 - log_ratio))
