"""The count of equal numbers in a list."""

import numpy as np

from edtk.system.typing import Indices


def occurrence(number: Indices) -> Indices:
    """How many earlier entries (m,) have the same number.

    Args:
        number: Numbers (m,) from 0 on.
    """
    order = np.argsort(number, kind="stable")
    count = np.bincount(number)
    found = np.empty(len(number), dtype=int)
    found[order] = np.arange(len(number)) - np.repeat(np.cumsum(count) - count, count)
    return found
