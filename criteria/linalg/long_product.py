"""Products of matrices whose terms cancel, summed in more digits than a double has."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from criteria.linalg.typing import Array

# x86 has numbers of 64 binary digits; on Windows and on Apple's machines the longest are doubles.
IS_LONGER = np.finfo(np.longdouble).eps < np.finfo(float).eps
SPLIT = 2.0**27 + 1  # halves the 53 digits of a double (Veltkamp)
# Relative to the sum of sizes of the terms, and for each of them; Dot2 is better by 2^-42.
EPS_OF_SUM = float(np.finfo(np.longdouble).eps) if IS_LONGER else 2.0**-63


def long_product(A: Array, T: Array) -> NDArray[np.floating[Any]]:
    """``A T`` (..., k, q) of A (..., k, p) and T (p, q), summed in long numbers, and left in them.

    On machines without such numbers it is in doubles, as if it had been summed in longer ones.
    Where T whitens nearly dependent parameters, the terms of a combination cancel, and doubles
    would keep ``eps`` of the terms instead of their sum.
    """
    if IS_LONGER:
        return np.asarray(A.astype(np.longdouble) @ T.astype(np.longdouble))
    return compensated_product(A, T)


def compensated_product(A: Array, T: Array) -> Array:
    """``A T`` (..., k, q) by doubles alone, as if summed in twice their digits.

    It is Dot2 of Ogita, Rump and Oishi, Accurate sum and dot product, SIAM J. Sci. Comput. 26
    (2005), for all entries at once: each product and each sum comes with its exact rounding error
    (Dekker, Knuth), and the errors are summed beside.
    """
    A_high, A_low = _halves(A)
    T_high, T_low = _halves(T)
    total = np.zeros((*A.shape[:-1], T.shape[1]))
    lost = np.zeros_like(total)
    for j in range(len(T)):
        a, a_high, a_low = (x[..., j, None] for x in (A, A_high, A_low))
        term = a * T[j]
        higher = term - a_high * T_high[j] - a_low * T_high[j] - a_high * T_low[j]
        lost += a_low * T_low[j] - higher
        before = total
        total = before + term
        kept = total - before
        lost += (before - (total - kept)) + (term - kept)
    return np.asarray(total + lost)


def _halves(x: Array) -> tuple[Array, Array]:
    """Two numbers of 26 digits whose sum is x."""
    scaled = SPLIT * x
    high = scaled - (scaled - x)
    return high, x - high
