"""Tails and quantiles of the distributions that tests and intervals need.

They are those of `scipy.stats`, to the last digit: the same special functions without that module's
import, which takes longer than most commands, and without its checks, which take longer than a fit.
"""

import numpy as np
from numpy.typing import ArrayLike

from edtk.system.typing import Array

CERTAIN = 1e8  # noncentrality at which no threshold of a test is missed


def chi_square_tail(x: ArrayLike, dof: ArrayLike) -> Array:
    """Probability that a chi-square with `dof` > 0 degrees of freedom is larger than x."""
    from scipy.special import chdtrc

    return np.asarray(chdtrc(dof, x))


def chi_square_quantile(probability: ArrayLike, dof: ArrayLike) -> Array:
    """The x that a chi-square with `dof` > 0 degrees of freedom is below with a probability."""
    from scipy.special import gammaincinv

    return np.asarray(2 * gammaincinv(np.asarray(dof) / 2, probability))


def noncentral_chi_square_tail(x: float, dof: float, noncentrality: float) -> float:
    """Probability that a noncentral chi-square is larger than x."""
    from scipy.special import chndtr

    # The function has no value from about 1e16 on, where chances have long been one.
    return float(1 - chndtr(x, dof, min(noncentrality, CERTAIN)))


def fisher_tail(x: ArrayLike, numerator_dof: ArrayLike, denominator_dof: ArrayLike) -> Array:
    """Probability that a variable with Fisher's F distribution is larger than x >= 0."""
    from scipy.special import fdtrc

    return np.asarray(fdtrc(numerator_dof, denominator_dof, x))


def fisher_quantile(
    probability: ArrayLike, numerator_dof: ArrayLike, denominator_dof: ArrayLike
) -> Array:
    """The x that a variable with Fisher's F distribution is below with a probability."""
    from scipy.special import fdtri

    return np.asarray(fdtri(numerator_dof, denominator_dof, probability))


def student_quantile(probability: ArrayLike, dof: ArrayLike) -> Array:
    """The x that Student's t is below with a probability; that of a normal for infinite `dof`."""
    from scipy.special import stdtrit

    return np.asarray(stdtrit(dof, probability))


def student_below(x: ArrayLike, dof: ArrayLike) -> Array:
    """Probability that Student's t is below x; that of a normal variable for infinite `dof`."""
    from scipy.special import stdtr

    return np.asarray(stdtr(dof, x))


def normal_quantile(probability: ArrayLike) -> Array:
    """The x that a standard normal variable is below with a probability."""
    from scipy.special import ndtri

    return np.asarray(ndtri(probability))


def log_normal_below(x: ArrayLike) -> Array:
    """Logarithm of the probability that a standard normal variable is below x."""
    from scipy.special import log_ndtr

    return np.asarray(log_ndtr(x))


def poisson_tail(count: ArrayLike, mean: ArrayLike) -> Array:
    """Probability that a Poisson variable is larger than a count of at least zero."""
    from scipy.special import pdtrc

    return np.asarray(pdtrc(count, mean))
