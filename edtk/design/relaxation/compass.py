"""The last bit of the way up, without derivatives: a model may have kinks where ascents stop."""

from collections.abc import Callable

import numpy as np

from edtk.design.region import Region
from edtk.system.typing import Array

FIRST = 3e-4  # parts of a range: the first step
SMALLER = 0.35  # a step in vain is followed by one of this part
ROUNDS = 20  # so that the last steps are of 1e-12


def compass(region: Region, x: Array, value: Callable[[Array], Array]) -> Array:
    """Climb to and fro along the axes, with smaller and smaller steps, many points at once.

    Args:
        region: The region.
        x: Feasible points (n, d).
        value: Maps points (2d, n, d) to their values (2d, n), and (1, n, d) likewise.

    Returns:
        Feasible points (n, d), no lower than the given ones.
    """
    low, high = region.limits
    x = x.copy()
    best = value(x[None])[0]
    step = np.full(len(x), FIRST)
    axes = np.concatenate([np.eye(region.size), -np.eye(region.size)])
    each = np.arange(len(x))
    for _ in range(ROUNDS):
        trials = x + step[:, None] * (axes * (high - low))[:, None]
        trials = np.clip(trials, low, high)
        values = np.where(region.at(trials).feasible, value(trials), -np.inf)
        top = values.argmax(axis=0)
        better = values[top, each] > best
        x[better] = trials[top, each][better]
        best = np.where(better, values[top, each], best)
        step = np.where(better, step, SMALLER * step)
    return x
