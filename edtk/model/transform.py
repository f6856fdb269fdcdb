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
        T[:3, :3] = _rotation(np.asarray(rpy, dtype=float))
    T[:3, 3] = position
    return T


def _rotation(rpy: Array) -> Array:
    """``Rz(yaw) Ry(pitch) Rx(roll)`` (3, 3), written out: scipy's takes 0.2 s to import."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpy), np.cos(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
