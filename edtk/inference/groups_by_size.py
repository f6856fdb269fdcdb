"""The members of numbered groups."""

from collections.abc import Iterator

import numpy as np

from edtk.system.typing import Indices


def groups_by_size(group: Indices) -> Iterator[Indices]:
    """Members (G, s) of groups, those of one size together.

    Args:
        group: Number (m,) of each member's group, all numbers from 0 on.
    """
    order = np.argsort(group, kind="stable")
    count = np.bincount(group)
    first = np.cumsum(count) - count
    for size in np.unique(count):
        start = first[count == size]
        yield order[start[:, None] + np.arange(size)]
