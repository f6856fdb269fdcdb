"""Experiments that tell something different from each other."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int_]


def distinct(blocks: Array, T: Array, tolerance: float) -> Indices:
    """Indices of blocks (k, p, p) that differ from every one before them that is kept.

    Poses that a symmetry of robot and load maps onto each other have the same information, whatever the symmetry.

    Args:
        blocks: Information of poses (k, p, p), the preferred ones first.
        T: What whitens the parameters (p, p).
        tolerance: Relative difference below which two are the same.
    """
    W = (T.T @ blocks @ T).reshape(len(blocks), -1)
    kept: list[int] = []
    for i, w in enumerate(W):
        if not kept or np.linalg.norm(W[kept] - w, axis=1).min() > tolerance * np.linalg.norm(w):
            kept.append(i)
    return np.array(kept, dtype=int)
