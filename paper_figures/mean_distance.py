"""Exact mean length of a normal vector."""

import numpy as np

from edtk.system.typing import Array

# Nodes of the quadrature; the mean of a single direction then has twelve digits.
NODES = 200


def mean_distance(cov: Array) -> Array:
    """``E|x|`` for ``x ~ N(0, cov)``, by one integral over the eigenvalues l_i of cov.

    From ``sqrt(s) = 1/(2 sqrt(pi)) int_0^inf (1 - exp(-s t)) t^(-3/2) dt`` with s = |x|^2 and
    ``E exp(-t |x|^2) = prod (1 + 2 l_i t)^(-1/2)`` follows, with ``t = u^2``,

        ``E|x| = 1/sqrt(pi) int_0^inf (1 - prod (1 + 2 l_i u^2)^(-1/2)) u^(-2) du``,

    and ``u = tan(a)``, ``du/u^2 = da/sin(a)^2``, makes the integrand smooth on the interval
    0 .. pi/2, so that Gauss-Legendre quadrature converges fast. The eigenvalues are first divided
    by their sum.

    Args:
        cov: Covariance matrices (..., n, n), with at least one entry not zero [m^2].

    Returns:
        Mean lengths (...) [m]. The root mean square, Eq. (20), is ``sqrt(trace(cov))``, and never
        smaller.
    """
    trace = np.trace(cov, axis1=-2, axis2=-1)
    share = np.linalg.eigvalsh(cov / trace[..., None, None]).clip(min=0.0)
    node, share_of_interval = np.polynomial.legendre.leggauss(NODES)
    angle = (node + 1) * np.pi / 4
    weight = share_of_interval * np.pi / 4
    logarithms = np.log1p(2.0 * share[..., None, :] * np.tan(angle)[:, None] ** 2).sum(axis=-1)
    # 1 - exp(x) loses its digits where x is near zero, at small angles.
    integrand = -np.expm1(-0.5 * logarithms) / np.sin(angle) ** 2
    mean: Array = np.sqrt(trace / np.pi) * (integrand @ weight)
    return mean
