"""How the columns of a Jacobian turn with the joints, weighted."""

import numpy as np

from edtk.model.frames import cross
from edtk.system.typing import Array


def columns_slope(linear: Array, angular: Array, f: Array, t: Array | None = None) -> Array:
    """Derivatives of ``sum_j v_j.f_j + w_j.t_j`` by all joint variables, f and t held fixed.

    ``(v_j, w_j)`` are the columns of the Jacobian of one point. A joint k at or before j turns both
    about its axis if it is revolute, ``d(v_j, w_j)/dq_k = (w_k x v_j, w_k x w_j)``, and a joint k
    behind a revolute j moves the point, ``(w_j x v_k, 0)``. So

        d/dq_k = w_k . sum_{j >= k} (v_j x f_j + w_j x t_j) + v_k . sum_{j < k} f_j x w_j.

    Args:
        linear: Columns v (n, 3, ...), zero for joints that do not move the point.
        angular: Columns w (n, 3, ...), zero for these too.
        f: Weights (n, 3, ...) of v.
        t: Weights (n, 3, ...) of w; None for zero.

    Returns:
        Derivatives (n, ...).
    """
    turning = cross(linear, f)
    if t is not None:
        turning += cross(angular, t)
    return summed_slope(linear, angular, turning, cross(f, angular))


def summed_slope(linear: Array, angular: Array, turning: Array, moving: Array) -> Array:
    """``w_k . sum_{j >= k} turning_j + v_k . sum_{j < k} moving_j`` (n, ...), for each joint k.

    Sums are added up in place, a joint at a time: over the first of several axes numpy's own
    cumulative sums take twice as long.

    Args:
        linear: Columns v (n, 3, ...).
        angular: Columns w (n, 3, ...).
        turning: Terms (n, 3, ...), which are overwritten.
        moving: Terms (n, 3, ...), likewise.
    """
    last = len(turning) - 1
    for k in range(last, 0, -1):
        turning[k - 1] += turning[k]
    for k in range(1, last):
        moving[k] += moving[k - 1]
    slope = dot(angular, turning)
    slope[1:] += dot(linear[1:], moving[:last])
    return slope


def dot(a: Array, b: Array) -> Array:
    """Sums of products (n, ...) along the second axis of a and b, (n, c, ...) or (1, c, ...)."""
    return np.asarray(np.einsum("nc...,nc...->n...", a, b))
