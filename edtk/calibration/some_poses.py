"""The rows of some of very many poses."""

import numpy as np

from edtk.system.typing import Indices

MOST_POSES = 2000  # of more, every second, third, ... is enough to tell how far robots bend


def some_poses(pose: Indices) -> Indices:
    """Choose the rows of at most `MOST_POSES` poses, with all their repetitions.

    Args:
        pose: Number (m,) of each row's pose, counted from 0.
    """
    every = -(-(1 + int(pose.max())) // MOST_POSES)
    return np.flatnonzero(pose % every == 0)
