"""What may be an information matrix."""

import numpy as np

from criteria.linalg.is_semidefinite import is_semidefinite
from edtk.design.nearly_equal import nearly_equal
from edtk.system.typing import Array

SYMMETRIC = 1e-9  # difference across the diagonal that is rounding


def is_information(M: Array) -> bool:
    """Whether a matrix (p, p) may be information."""
    if not np.isfinite(M).all() or not nearly_equal(M, M.T, SYMMETRIC):
        return False
    return bool(is_semidefinite(M))
