"""Slopes of the regressors of a robot that is loaded and measured at its tool point."""

import numpy as np
from numpy.typing import ArrayLike

from edtk.model.columns_slope import dot, summed_slope
from edtk.model.force_and_torque import force_and_torque
from edtk.model.frames import Frames, cross
from edtk.system.as_slice import as_slice
from edtk.system.typing import Array


def slope_at_tool_point(frames: Frames, wrench: ArrayLike, joints: list[int], B: Array) -> Array:
    """Derivatives of ``<B, A>`` in one pass, see `ElastostaticModel.regressor_slope`.

    With ``(b_j, c_j)`` the column of B and ``s_j = v_j.b_j + w_j.c_j``, both terms are those of
    one point, with the weights

        f_j = tau_j b_j + s_j F,   t_j = tau_j c_j + s_j T.

    Args:
        frames: The poses.
        wrench: Forces and torques (..., 6) or (6,) [N, N m].
        joints: Indices (p,) of the joints that have a column.
        B: Weights (p, 3 or 6, ...); six where rotations are measured too.

    Returns:
        Derivatives (n, ...).
    """
    which = as_slice(joints)
    v = frames.linear[which]
    w = frames.angular[which]
    F, T = force_and_torque(wrench, frames)
    tau = dot(v, F)
    s = dot(v, B[:, :3])
    # The terms of torques and measured rotations are left out where all of them are zero.
    rotations = B.shape[1] == 6
    turned = rotations or bool(T.any())
    if turned:
        tau += dot(w, T)
    if rotations:
        s += dot(w, B[:, 3:])
    f = tau[:, None] * B[:, :3] + s[:, None] * F
    turning, moving = np.zeros((2, len(frames.q), *f.shape[1:]))
    turning[which] = cross(v, f)
    moving[which] = cross(f, w)
    if turned:
        t = s[:, None] * T
        if rotations:
            t = t + tau[:, None] * B[:, 3:]
        turning[which] += cross(w, t)
    return summed_slope(frames.linear, frames.angular, turning, moving)
