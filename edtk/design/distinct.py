"""Experiments whose information differs from each other."""

import numpy as np

from edtk.system.typing import Array, Indices


def distinct(blocks: Array, T: Array, tolerance: float, most: int | None = None) -> Indices:
    """Choose experiments no two of which tell the same.

    Poses that a symmetry of robot and load maps onto each other have the same information. The
    comparison of information finds them without knowing the symmetry.

    Args:
        blocks: Information matrices (n, p, p), the preferred ones first.
        T: Matrix (p, r) that whitens the parameters, as far as they are known.
        tolerance: Relative difference up to which two experiments count as the same.
        most: Number of experiments after which to stop; by default all are compared.

    Returns:
        Indices of the experiments that differ from every preferred one that was chosen.
    """
    whitened = (T.T @ blocks @ T).reshape(len(blocks), -1)
    chosen: list[int] = []
    for i, own in enumerate(whitened):
        if len(chosen) == most:
            break
        least = tolerance * np.linalg.norm(own)
        if not chosen or np.linalg.norm(whitened[chosen] - own, axis=1).min() > least:
            chosen.append(i)
    return np.array(chosen, dtype=int)
