"""The two parts of a wrench, beside poses whose frames are at hand."""

import numpy as np
from numpy.typing import ArrayLike

from edtk.model.frames import Frames
from edtk.system.typing import Array


def force_and_torque(wrench: ArrayLike, frames: Frames) -> tuple[Array, Array]:
    """Force and torque (1, 3, ...), component first, aligned with the last axes of the frames.

    Args:
        wrench: Forces and torques (..., 6) or (6,) [N, N m].
        frames: The poses.
    """
    W = np.asarray(wrench, dtype=float)
    W = W.transpose(-1, *range(W.ndim - 1))
    W = W[(slice(None),) + (None,) * (frames.position.ndim - W.ndim)]
    return W[None, :3], W[None, 3:]
