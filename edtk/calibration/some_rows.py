"""Some of very many rows."""

import numpy as np

from edtk.system.typing import Indices


def some_rows(count: int, most: int) -> Indices:
    """Choose rows by chance, as every second row may be of the same pose.

    Args:
        count: Number of rows.
        most: How many are wanted, at most.

    Returns:
        Rows in their order, counted from 0; all of them if they are not too many.
    """
    if count <= most:
        return np.arange(count)
    return np.sort(np.random.default_rng(0).choice(count, most, replace=False))
