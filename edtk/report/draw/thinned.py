"""Which of many points a picture shows."""

import numpy as np

from edtk.system.typing import Array, Indices

MOST = 500  # points that are drawn evenly, and as many of the largest


def thinned(sizes: Array) -> Indices:
    """Indices of all points, or of many some and the largest."""
    m = len(sizes)
    if m <= 2 * MOST:
        return np.arange(m)
    largest = np.argpartition(-sizes, MOST)[:MOST]
    return np.union1d(np.linspace(0, m - 1, MOST).astype(int), largest)
