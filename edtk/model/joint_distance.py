"""How far apart poses are, as angles of their joints."""

import numpy as np

from edtk.system.typing import Array, Mask


def joint_distance(q: Array, other: Array, prismatic: Mask) -> Array:
    """Distances (...) of poses [rad]: Euclidean over the revolute joints, the short way round.

    Args:
        q: Poses (..., n) [rad or m].
        other: Poses (..., n) to which the distances are.
        prismatic: Which joints (n,) are prismatic; they do not count.
    """
    turn = np.mod((q - other)[..., ~prismatic] + np.pi, 2 * np.pi) - np.pi
    return np.asarray(np.sqrt(np.square(turn).sum(axis=-1)))
