"""How large the error |A dk| of a compensation may be."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from edtk.inference.distributions import chi_square_quantile, fisher_quantile
from edtk.system.typing import Array

# Nodes of the quadrature along Talbot's contour. Its error is of the order 3.9^-NODES, and its
# rounding some 60 times that of a double: more nodes would only add rounding.
NODES = 24

# Nodes of the quadrature over an estimated noise, by its degrees of freedom.
SMOOTH_DOF = 3
LEGENDRE_NODES = 256
HERMITE_NODES = 48


def weighted_chi_square_cdf(x: ArrayLike, weights: ArrayLike) -> Array:
    """Probability ``P(sum_i l_i z_i^2 <= x)`` with independent standard normal z.

    The Laplace transform of the distribution function is ``prod_i (1 + 2 l_i s)^(-1/2) / s``. Its
    singularities all lie on the negative real axis and in 0, so that Talbot's contour around them
    inverts it with geometric convergence, whatever the weights; the contour is that of Trefethen,
    Weideman and Schmelzer, BIT 46 (2006) 653, Eq. (3.2).

    Args:
        x: Where to evaluate (...,), above zero.
        weights: The weights l (..., r), not negative and not all zero.

    Returns:
        Probabilities (...).
    """
    x = np.asarray(x, dtype=float)
    weights = np.asarray(weights, dtype=float)
    # Half of the contour: the other half is its complex conjugate.
    angle = (2 * np.arange(NODES // 2) + 1) * np.pi / NODES
    c = 0.6407 * angle
    z = NODES * (-0.6122 + 0.5017 * angle / np.tan(c) + 0.2645j * angle)
    dz = NODES * (0.5017 / np.tan(c) - 0.5017 * c / np.sin(c) ** 2 + 0.2645j)
    factors = np.sqrt(1 + 2 * (weights / x[..., None])[..., None, :] * z[:, None]).prod(axis=-1)
    total = (np.exp(z) / (factors * z) * dz).sum(axis=-1)
    return np.clip(2 * total.imag / NODES, 0.0, 1.0)


def error_quantiles(A: Array, cov: Array, levels: ArrayLike, dof: float = np.inf) -> Array:
    """Quantiles of ``|A dk|`` for errors dk with that covariance.

    ``|A dk|^2 = sum_i l_i z_i^2 / s`` with the eigenvalues l of ``A cov A'``, where s is one for
    normal dk, and chi-square over its degrees of freedom, independent of z, for Student's t. The
    quantile lies between those of ``l_1 z_1^2 / s`` and of ``l_1 (z_1^2 + ... + z_r^2) / s``, l_1
    being the largest, where Brent's method finds it.

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
    scatter = _Scatter(dof, *_estimated(dof))
    for i in np.ndindex(*spectrum.shape[:-1]):
        largest = spectrum[i].max()
        if largest > 0:
            weights = spectrum[i] / largest
            found[i] = [np.sqrt(largest * _quantile(weights, level, scatter)) for level in levels]
    return found


@dataclass(frozen=True, eq=False)
class _Scatter:
    """The noise over its estimate, squared: s of the docstring above.

    Attributes:
        dof: Degrees of freedom of the estimate; inf where the noise is known.
        scales: Values (n,) of s.
        shares: Their probabilities (n,).
    """

    dof: float
    scales: Array
    shares: Array

    def quantile(self, level: float, n: int) -> float:
        """Quantile of ``(z_1^2 + ... + z_n^2) / s``."""
        if np.isinf(self.dof):
            return float(chi_square_quantile(level, n))
        return float(n * fisher_quantile(level, n, self.dof))


@cache
def _estimated(dof: float) -> tuple[Array, Array]:
    """Nodes (n,) and probabilities (n,) of chi-square over its degrees of freedom.

    As a function of the normal variable of the same rank it is smooth, as Gauss-Hermite quadrature
    wants it. With fewer than three degrees its tails are too heavy for that; then the rule is that
    of Gauss and Legendre over the probability.
    """
    if np.isinf(dof):
        return np.ones(1), np.ones(1)
    from scipy.special import chdtri, ndtr

    if dof < SMOOTH_DOF:
        z, share = np.polynomial.legendre.leggauss(LEGENDRE_NODES)
        return chi_square_quantile((1 + z) / 2, dof) / dof, share / 2
    z, share = np.polynomial.hermite_e.hermegauss(HERMITE_NODES)
    # Each half by its own tail: probabilities near one have no digits left.
    lower = chi_square_quantile(ndtr(z), dof)
    upper = chdtri(dof, ndtr(-z))
    quantiles = np.where(z < 0, lower, upper)
    return quantiles / dof, share / share.sum()


def _quantile(weights: Array, level: float, scatter: _Scatter) -> float:
    """The quantile of ``sum_i l_i z_i^2 / s`` for weights l (r,) whose largest is one."""
    from scipy.optimize import brentq

    low = scatter.quantile(level, 1)
    high = scatter.quantile(level, len(weights))

    def excess(x: float) -> float:
        probabilities = weighted_chi_square_cdf(x * scatter.scales, weights)
        return float(scatter.shares @ probabilities) - level

    # With a single weight that counts the quantile is an end of the bracket, which rounding may
    # exclude.
    if excess(low) >= 0:
        return low
    if excess(high) <= 0:
        return high
    return float(brentq(excess, low, high, xtol=1e-300, rtol=1e-12))
