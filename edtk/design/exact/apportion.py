"""From weights to whole numbers of experiments."""

import numpy as np
from numpy.typing import ArrayLike

from edtk.system.typing import Array, Indices


def apportion(weights: ArrayLike, m: int) -> Indices:
    """Round the weights of a relaxed design to m whole experiments, as efficiently as possible.

    The efficient apportionment of Pukelsheim and Rieder (Biometrika 79, 1992) starts from
    ``n_i = ceil((m - l/2) w_i)`` over the l support points. It raises the entry with the least
    ``n_i / w_i``, or lowers the one with the largest ``(n_i - 1) / w_i``, until the sum is m. The
    result has the largest ``min_i n_i/(m w_i)`` of all roundings, which bounds its efficiency under
    every criterion.

    Args:
        weights: Non-negative weights w (n,), not all zero; their sum does not matter.
        m: Number of experiments, at least one. Where m is smaller than the support, the m largest
            weights have one experiment each.

    Returns:
        Numbers of experiments (n,), of sum m; points without weight have none.

    Raises:
        ValueError: The weights or m are not of that kind.

    Example:
        >>> import edtk
        >>> edtk.apportion([0.52, 0.31, 0.17], 10)
        array([5, 3, 2])
    """
    w = np.asarray(weights, dtype=float)
    if m < 1 or w.ndim != 1 or not np.isfinite(w).all() or (w < 0).any() or not w.any():
        raise ValueError("apportion needs m >= 1 and non-negative weights that are not all zero")
    support = np.flatnonzero(w)
    if len(support) > m:
        # A stable sort lets the first of equal weights win, so that the result is repeatable.
        heaviest = np.argsort(-w[support], kind="stable")[:m]
        support = np.sort(support[heaviest])
    share = w[support] / w[support].sum()
    count = np.ceil((m - len(share) / 2) * share).astype(int)
    # With m near l/2 the ceiling of a small share is zero, which would drop a support point.
    count = np.maximum(count, 1)
    result = np.zeros(len(w), dtype=int)
    result[support] = _with_sum(m, count, share)
    return result


def _with_sum(m: int, count: Indices, share: Array) -> Indices:
    """Counts (l,) of sum m, after the fewest steps up or down from the given ones."""
    count = count.copy()
    while count.sum() < m:
        count[np.argmin(count / share)] += 1
    while count.sum() > m:
        count[np.argmax((count - 1) / share)] -= 1
    return count
