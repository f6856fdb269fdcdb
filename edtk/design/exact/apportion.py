"""From weights to whole numbers of experiments."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def apportion(weights: ArrayLike, m: int) -> NDArray[np.int_]:
    """Efficient apportionment of m experiments (Pukelsheim and Rieder, 1992).

    Starts from ``ceil((m - l/2) w_i)`` over the l support points, then raises the entry with the least
    ``n_i / w_i`` or lowers the one with the largest ``(n_i - 1) / w_i`` until the sum is m. Where m is smaller
    than the support, only the m largest weights are kept: each remaining point could have one at most.

    Args:
        weights: Non-negative weights (n,), not all zero.
        m: Number of experiments, at least one.

    Returns:
        Whole numbers (n,) that sum to m.

    Raises:
        ValueError: The weights or m are not of that kind.
    """
    w = np.asarray(weights, dtype=float)
    if m < 1 or w.ndim != 1 or not np.isfinite(w).all() or (w < 0).any() or not w.any():
        raise ValueError("apportion needs m >= 1 and non-negative weights that are not all zero")
    support = np.flatnonzero(w)
    if len(support) > m:
        support = np.sort(support[np.argsort(-w[support], kind="stable")[:m]])
    share = w[support] / w[support].sum()
    count = np.ceil((m - len(share) / 2) * share).astype(int)
    count = np.maximum(count, 1)
    while count.sum() < m:
        count[np.argmin(count / share)] += 1
    while count.sum() > m:
        count[np.argmax((count - 1) / share)] -= 1
    result = np.zeros(len(w), dtype=int)
    result[support] = count
    return result
