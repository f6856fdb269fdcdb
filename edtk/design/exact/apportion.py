"""From weights to whole numbers of experiments, and how often to measure each of a few poses."""

import numpy as np
from numpy.typing import ArrayLike

from criteria import Criterion
from edtk.design.exact.counts.prices import first_few_largest, first_lowest
from edtk.system.errors import ArgumentError, finite_numbers, whole_number
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array, Indices

MOVES_AT_ONCE = 20_000  # their matrices, of some megabytes, stay in a core's cache
MOST = 10**15  # experiments, all of whose numbers are exact as doubles
GAIN_OF_MOVE = 1e-12  # relative improvement that counts: less than this may be rounding
# Relative difference up to which weights are alike, the gap that relaxations are solved to: of
# symmetric candidates the first ones win, whatever the last digits are.
SAME_WEIGHT = 1e-6


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
        ArgumentError: The weights or m are not of that kind.

    Example:
        >>> import edtk
        >>> edtk.apportion([0.52, 0.31, 0.17], 10)
        array([5, 3, 2])
    """
    w = finite_numbers(weights, "weights")
    if w.ndim != 1 or not (w >= 0).all() or not w.any():
        message = "expected numbers (n,) from zero, not all of them zero"
        raise ArgumentError(message, argument="weights")
    m = whole_number(m, "m", 1)
    if m > MOST:
        raise ArgumentError(f"expected {MOST:.0e} at most", argument="m", given=m)
    support = np.flatnonzero(w)
    if len(support) > m:
        support = support[first_few_largest(w[support][None], m, SAME_WEIGHT)[0]]
    share = w[support] / w[support].sum()
    count = np.ceil((m - len(share) / 2) * share * (1 - SAME_WEIGHT)).astype(int)
    # With m near l/2 the ceiling of a small share is zero, which would drop a support point.
    count = np.maximum(count, 1)
    result = np.zeros(len(w), dtype=int)
    result[support] = _with_sum(m, count, share)
    return result


def _with_sum(m: int, count: Indices, share: Array) -> Indices:
    """Counts (l,) of sum m, after the fewest steps up or down from the given ones."""
    count = count.copy()
    while count.sum() < m:
        count[first_lowest(count / share, SAME_WEIGHT)] += 1
    while count.sum() > m:
        count[first_lowest((1 - count) / share, SAME_WEIGHT)] -= 1
    return count


def best_repeats(
    criterion: Criterion, blocks: Array, repeats: Array, prior: Array | None = None
) -> Array:
    """Distribute measurements over poses so that no single move improves the plan.

    A move gives measurements of one pose to another. The best one is made as long as it lowers the
    cost. It has many measurements at first, half as many when that no longer helps, at last one.

    Args:
        criterion: The criterion to improve.
        blocks: Information of one measurement in each pose (k, p, p).
        repeats: Whole numbers to start from (k,); zero is allowed.
        prior: Prior information (p, p) per single measurement, see `Problem`.

    Returns:
        Whole numbers (k,) of the same sum, whose cost no move of a single measurement lowers; the
        best so far where time is over (`time_limit`).
    """
    r = np.array(repeats, dtype=float)
    k = len(r)
    constant = 0.0 if prior is None else r.sum() * prior
    M = np.tensordot(r, blocks, 1) + constant
    cost = float(criterion.cost(M))
    moved = 2.0 ** np.floor(np.log2(max(1.0, r.sum() / k)))
    while k > 1 and moved >= 1 and not out_of_time():
        costs = _costs_of_moves(criterion, blocks, M, r, moved)
        to, source = divmod(int(costs.argmin()), k)
        tried = r.copy()
        tried[to] += moved
        tried[source] -= moved
        # The sum is computed anew. An update would let rounding accumulate, and equal poses would
        # be exchanged for ever, each time for an imaginary gain.
        trial = np.tensordot(tried, blocks, 1) + constant
        reached = float(criterion.cost(trial))
        if max(reached, float(costs[to, source])) < cost * (1 - GAIN_OF_MOVE):
            r = tried
            M = trial
            cost = reached
        else:
            moved /= 2
    return r


def _costs_of_moves(criterion: Criterion, blocks: Array, M: Array, r: Array, moved: float) -> Array:
    """Costs (k, k) after a move to the first pose from the second; inf where it has too few."""
    k = len(r)
    costs = np.empty((k, k))
    parts = -(-k * k // MOVES_AT_ONCE)
    for part in np.array_split(np.arange(k), parts):
        costs[part] = criterion.cost(M + moved * (blocks[part, None] - blocks))
    costs[:, r < moved] = np.inf
    return costs
