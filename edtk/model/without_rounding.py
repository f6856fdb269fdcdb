"""Numbers that are nothing but the rounding of others."""

import numpy as np
from numpy.typing import ArrayLike

from edtk.system.typing import Array

# Rounding of sums and products along a chain of joints, relative to the size of their terms.
ROUNDING = 64 * np.finfo(float).eps


def without_rounding(x: Array, size: ArrayLike) -> Array:
    """Numbers x, of which those that are the rounding of numbers of that size are set to zero.

    A joint that the load does not turn, or whose axis runs through the tool point, then has an
    exactly zero column; left as rounding noise, it would be scaled up and pass as identified.
    """
    return np.where(np.abs(x) <= ROUNDING * np.asarray(size), 0.0, x)
