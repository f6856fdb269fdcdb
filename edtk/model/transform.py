"""Homogeneous transforms: how robots, bases and tools are placed."""

import numpy as np
from numpy.typing import ArrayLike

from edtk.system.typing import Array


def transform(position: ArrayLike = (0, 0, 0), rpy: ArrayLike = (0, 0, 0)) -> Array:
    """Place one frame in another.

    Args:
        position: Origin (3,) of the frame [m].
        rpy: Roll, pitch and yaw (3,) about the fixed x, y and z axes, in this order [rad].

    Returns:
        Homogeneous transform (4, 4) [m].
    """
    T = np.eye(4)
    if np.any(rpy):
        # Imported here, as it takes 0.2 s and most robots have no rotated frame.
        from scipy.spatial.transform import Rotation

        T[:3, :3] = Rotation.from_euler("xyz", np.asarray(rpy, dtype=float)).as_matrix()
    T[:3, 3] = position
    return T
