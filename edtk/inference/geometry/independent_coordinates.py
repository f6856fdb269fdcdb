"""As how many independent coordinates those of poses count, which err together."""

import numpy as np

from edtk.system.typing import Array, Mask

# With the density phi and the bound z of a normal number, ``2 (z phi(z))^2`` of the variance
# ``0.05 * 0.95`` of its being outside: the part that grows with the square of a correlation.
OF_SQUARE = 0.5525


def independent_coordinates(covariance: Array, seen: Mask, scaled: bool) -> float:
    """As many independent coordinates have shares inside that vary as much.

    Whether a normal number is beyond its bounds is a sum of Hermite polynomials of even order, so
    that of two numbers with the correlation c the covariance is ``sum_k a_k^2 c^k``, k = 2, 4 ...;
    here it is bounded by that of order two and ``c^4`` for the rest. The number is that of all
    coordinates over the mean over them of the sums of these, as a share of their own variance
    (Rao and Scott 1981). Errors of different poses count as independent.

    Where the size of the errors was fitted to themselves, their mean square is what the bands say:
    the sum of all polynomials of order two, ``z^2 - 1``, is none, and that order drops out.

    Args:
        covariance: Of the coordinates of each pose (m, r, r).
        seen: Which of them (m, r) were measured.
        scaled: Whether the size of the errors was fitted.
    """
    variance = np.einsum("mrr->mr", covariance)
    root = np.sqrt(np.where(seen & (variance > 0), variance, np.inf))
    squares = (covariance / root[:, :, None] / root[:, None]) ** 2
    second = 0.0 if scaled else OF_SQUARE
    total = float((second * squares + (1 - OF_SQUARE) * squares**2).sum())
    return float(seen.sum()) ** 2 / total if total > 0 else 0.0
