"""The array types of edtk's signatures, under one name each, and indices as slices."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
"""Real numbers; the docstring that uses it says which shape and unit."""

Indices: TypeAlias = NDArray[np.int_]
"""Positions in another array, or counts."""

Mask: TypeAlias = NDArray[np.bool_]
"""Whether a statement holds, entry by entry."""


def as_slice(indices: Sequence[int]) -> slice | list[int]:
    """A slice where indices follow each other, which takes a view; else a list, which copies."""
    first, last = indices[0], indices[-1]
    own = list(indices)
    return slice(first, last + 1) if own == list(range(first, last + 1)) else own
