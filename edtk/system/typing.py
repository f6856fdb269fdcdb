"""The array types of edtk's signatures, under one name each."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
"""Real numbers; the docstring that uses it says which shape and unit."""

Indices: TypeAlias = NDArray[np.int_]
"""Positions in another array, or counts."""

Mask: TypeAlias = NDArray[np.bool_]
"""Whether a statement holds, entry by entry."""
