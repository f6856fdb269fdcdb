"""Whether two arrays are the same but for rounding."""

import numpy as np

from edtk.system.typing import Array


def nearly_equal(values: Array, others: Array, tolerance: float) -> bool:
    """Whether arrays are equal up to a part of their largest entry."""
    size = max(float(np.abs(others).max(initial=0.0)), float(np.abs(values).max(initial=0.0)))
    return bool(np.abs(values - others).max(initial=0.0) <= tolerance * size)
