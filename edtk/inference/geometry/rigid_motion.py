"""The rigid motion between two sets of points."""

import numpy as np

from edtk.system.typing import Array


def rigid_motion(points: Array, goals: Array) -> Array:
    """The motion T (4, 4) that takes points (r, 3) nearest to goals (r, 3) (Kabsch 1976)."""
    a = points.mean(axis=0)
    b = goals.mean(axis=0)
    U, _, Vt = np.linalg.svd((points - a).T @ (goals - b))
    turn = np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
    R = (U @ turn @ Vt).T
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = b - R @ a
    return T
