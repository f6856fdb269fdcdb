"""A frame whose z-axis is a given axis."""

import numpy as np

from edtk.model.vector_product import vector_product
from edtk.system.typing import Array


def aligned(axis: Array) -> Array:
    """A rotation (3, 3) whose third column is the axis.

    For a coordinate axis it is a signed permutation.
    """
    x = np.eye(3)[np.argmin(np.abs(axis))]
    x = x - axis * (axis @ x)
    x /= np.linalg.norm(x)
    return np.column_stack([x, vector_product(axis, x), axis])
