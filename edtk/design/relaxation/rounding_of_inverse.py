"""How many digits of a cost the inverse of an all but singular design leaves."""

import numpy as np

from edtk.system.typing import Array

EPS = float(np.finfo(float).eps)


def rounding_of_inverse(M: Array, variances: Array) -> float:
    """About the relative error of a cost that is computed from the inverse of a design.

    An inverse has entries of the size of the largest variance, and so has its rounding.
    Combinations that are told well lose these digits where others are all but open: with R = M at
    unit diagonal, about ``eps trace(R^-1)`` of their variances.

    Args:
        M: Design (p, p).
        variances: The diagonal (p,) of its inverse.
    """
    return EPS * float(np.diag(M) @ variances)
