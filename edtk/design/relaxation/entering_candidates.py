"""Which candidates enter a restricted master problem."""

import numpy as np

from edtk.system.typing import Array, Indices, Mask

# Candidates per one that enters from which on the choice is spread over parts of the list.
SPREAD = 20
# Sensitivities of a long list among which the largest are looked for first, and how many more of
# them than needed set the threshold for the others.
SAMPLE = 10_000
OVERSAMPLED = 8


def entering_candidates(sensitivities: Array, active: Indices, batch: int) -> Indices:
    """Choose which candidates enter the restricted master problem.

    The candidates of largest sensitivity are often alike. In a long list, a quarter of those that
    enter have the largest sensitivities of all; the others have the largest ones of as many equal
    parts of the list.

    Args:
        sensitivities: Sensitivities (n,) of all candidates.
        active: Candidates (k,) that are in the problem already.
        batch: Number of candidates to choose, at most.

    Returns:
        Indices of candidates that are not active, the largest sensitivity first.
    """
    n = len(sensitivities)
    size = min(batch + len(active), n)
    is_active = np.zeros(n, dtype=bool)
    is_active[active] = True
    largest = _largest(sensitivities, size)
    chosen = _inactive_by_sensitivity(sensitivities, is_active, largest)
    parts = 3 * batch // 4
    if parts and n >= SPREAD * batch:
        width = n // parts
        in_parts = sensitivities[: width * parts].reshape(parts, width)
        spread = in_parts.argmax(axis=1) + width * np.arange(parts)
        # No two of the spread ones are the same; those of both kinds are marked to count once.
        first = chosen[: batch - parts]
        is_active[first] = True
        others = np.sort(np.concatenate([first, spread[~is_active[spread]]]))
        chosen = others[np.argsort(-sensitivities[others], kind="stable")]
    return chosen[:batch]


def _largest(sensitivities: Array, size: int) -> Indices:
    """Indices of the largest sensitivities, in any order."""
    n = len(sensitivities)
    stride = n // SAMPLE
    if stride > 1 and size * OVERSAMPLED < SAMPLE:
        # A sample tells which sensitivities are too small to count; few others are left to compare.
        sample = sensitivities[::stride]
        rank = len(sample) - 1 - OVERSAMPLED * max(1, size // stride)
        least = np.partition(sample, rank)[rank]
        found = np.flatnonzero(sensitivities >= least)
        if len(found) >= size:
            return found[np.argpartition(-sensitivities[found], size - 1)[:size]]
    return np.argpartition(-sensitivities, size - 1)[:size]


def _inactive_by_sensitivity(sensitivities: Array, is_active: Mask, chosen: Indices) -> Indices:
    """Those of chosen candidates that are not active, the largest sensitivity first."""
    inactive = np.sort(chosen[~is_active[chosen]])
    return inactive[np.argsort(-sensitivities[inactive], kind="stable")]
