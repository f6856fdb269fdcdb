"""How large the error |A dk| of a compensation may be: quantiles of weighted sums of chi-squares."""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.stats import chi2, f, norm

Array = NDArray[np.float64]
NODES = 24  # the quadrature's error is of the order 3.9^-NODES, and its rounding some 60 times that of a double


def weighted_chi_square_cdf(x: ArrayLike, weights: ArrayLike) -> Array:
    """``P(sum_i l_i z_i^2 <= x)`` of independent standard normal z, for x > 0 and weights l >= 0, not all zero.

    The Laplace transform of the distribution function is ``prod_i (1 + 2 l_i s)^(-1/2) / s``. Its singularities all
    lie on the negative real axis and in 0, so that Talbot's contour around them inverts it with geometric convergence,
    whatever the weights; the contour is that of Trefethen, Weideman and Schmelzer, BIT 46 (2006) 653, Eq. (3.2).

    Args:
        x: Where to evaluate (...,).
        weights: The weights (..., r).

    Returns:
        Probabilities (...).
    """
    x, weights = np.asarray(x, dtype=float), np.asarray(weights, dtype=float)
    angle = (
        (2 * np.arange(NODES // 2) + 1) * np.pi / NODES
    )  # the other half is the complex conjugate
    c = 0.6407 * angle
    z = NODES * (-0.6122 + 0.5017 * angle / np.tan(c) + 0.2645j * angle)
    dz = NODES * (0.5017 / np.tan(c) - 0.5017 * c / np.sin(c) ** 2 + 0.2645j)
    factors = np.sqrt(1 + 2 * (weights / x[..., None])[..., None, :] * z[:, None]).prod(axis=-1)
    total = (np.exp(z) / (factors * z) * dz).sum(axis=-1)
    return np.clip(2 * total.imag / NODES, 0.0, 1.0)


def error_quantiles(A: Array, cov: Array, levels: ArrayLike, dof: float = np.inf) -> Array:
    """Quantiles of ``|A dk|`` for errors dk with that covariance.

    ``|A dk|^2 = sum_i l_i z_i^2 / s`` with the eigenvalues l of ``A cov A'``, where s is one for normal dk, and
    chi-square over its degrees of freedom, independent of z, for Student's t. The quantile lies between those of
    ``l_1 z_1^2 / s`` and of ``l_1 (z_1^2 + ... + z_r^2) / s``, l_1 being the largest, where Brent's method finds it.

    Args:
        A: Regressors (..., rows, p) of the task poses [m/(rad/(N m))].
        cov: Covariance (p, p) of the compliances; if dof is finite, the estimated one.
        levels: Probabilities (c,) strictly between 0 and 1.
        dof: Degrees of freedom of the covariance; inf where sigma is known.

    Returns:
        Quantiles (..., c) [m].
    """
    levels = np.asarray(levels, dtype=float)
    spectrum = np.maximum(np.linalg.eigvalsh(A @ cov @ np.swapaxes(A, -1, -2)), 0.0)
    found = np.zeros((*spectrum.shape[:-1], len(levels)))
    mixed = np.ones(1), np.ones(1)
    if np.isfinite(dof):
        mixed = _estimated(dof)
    for i in np.ndindex(*spectrum.shape[:-1]):
        largest = spectrum[i].max()
        if largest > 0:
            found[i] = [
                np.sqrt(largest * _quantile(spectrum[i] / largest, level, dof, *mixed))
                for level in levels
            ]
    return found


@cache
def _estimated(dof: float) -> tuple[Array, Array]:
    """Nodes (n,) and probabilities (n,) of chi-square over its degrees of freedom.

    As a function of the normal variable of the same rank it is smooth, which Gauss' and Hermite's rule wants. With
    fewer than three degrees its tails are too heavy for that; the rule is Gauss' and Legendre's over the probability.
    """
    if dof < 3:
        z, share = np.polynomial.legendre.leggauss(256)
        return chi2.ppf((1 + z) / 2, dof) / dof, share / 2
    z, share = np.polynomial.hermite_e.hermegauss(48)
    return np.where(
        z < 0, chi2.ppf(norm.cdf(z), dof), chi2.isf(norm.sf(z), dof)
    ) / dof, share / share.sum()


def _quantile(weights: Array, level: float, dof: float, scales: Array, shares: Array) -> float:
    """The quantile for weights whose largest is one, s being one of some scales with such probabilities."""
    r = len(weights)
    law = chi2.ppf if np.isinf(dof) else lambda level, n: n * f.ppf(level, n, dof)
    low, high = law(level, 1), law(level, r)

    def excess(x: float) -> float:
        return float(shares @ weighted_chi_square_cdf(x * scales, weights)) - level

    # With but one weight that counts, the quantile is an end of the bracket, which rounding may exclude.
    if excess(low) >= 0:
        return float(low)
    if excess(high) <= 0:
        return float(high)
    return float(brentq(excess, low, high, xtol=1e-300, rtol=1e-12))
