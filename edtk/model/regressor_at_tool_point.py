"""Regressors of a robot that is loaded and measured at its tool point: the common, fast case."""

import numpy as np
from numpy.typing import ArrayLike

from edtk.model.columns_slope import dot
from edtk.model.force_and_torque import force_and_torque
from edtk.model.frames import Frames
from edtk.model.without_rounding import without_rounding
from edtk.system.as_slice import as_slice
from edtk.system.typing import Array


def regressor_at_tool_point(
    frames: Frames, wrench: ArrayLike, joints: list[int], reach: float, turns: bool
) -> Array:
    """Column j is ``(v_j, w_j) tau_j``, as both factors belong to the same point.

    Args:
        frames: The poses.
        wrench: Forces and torques (..., 6) or (6,) [N, N m].
        joints: Indices (p,) of the joints that have a column.
        reach: Reach of the robot, against which rounding is judged [m].
        turns: Whether rotations are measured too.

    Returns:
        Regressors (p, 3 or 6, ...).
    """
    F, T = force_and_torque(wrench, frames)
    which = as_slice(joints)
    angular = frames.angular[which]
    linear = without_rounding(frames.linear[which], reach)
    torque = dot(linear, F)
    if T.any():
        torque += dot(angular, T)
    size = reach * np.abs(F).sum(axis=1) + np.abs(T).sum(axis=1)
    torque = without_rounding(torque, size)
    A = linear * torque[:, None]
    if not turns:
        return A
    return np.concatenate([A, angular * torque[:, None]], axis=1)
