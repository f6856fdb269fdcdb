"""How many visits of a plan share the discrepancy of each of its poses."""

import numpy as np
from numpy.typing import ArrayLike

from edtk.model.joint_distance import joint_distance
from edtk.system.typing import Array, Mask

SAME = 1e-9  # [rad]: poses nearer than this are one pose, whatever the distance that is asked for


def shared_visits(q: Array, repeats: ArrayLike, prismatic: Mask, within: float) -> Array:
    """Count the visits of poses that are nearer than a distance, the pose's own included.

    Errors of the model in v poses near each other have some correlation C (v, v) that nobody knows.
    Whatever it is, ``C <= v I``; and if only poses nearer than `within` are correlated at all, then
    ``C <= diag(v_i)`` with v_i the number of visits within that distance of visit i, since
    ``diag(v_i) - C`` is diagonally dominant. To count the variance of each pose v_i times is thus
    safe, and exact for repeats of one pose: a plan is worth at least what it is said to be.

    Args:
        q: Poses (k, n) [rad or m].
        repeats: Visits (k,) of each.
        prismatic: Which joints (n,) are prismatic; they do not count.
        within: The distance, Euclidean over the revolute joints, each difference taken the short
            way round [rad].

    Returns:
        Numbers of visits (k,).
    """
    limit = max(within * (1 - SAME), SAME)
    visits = np.asarray(repeats, dtype=float)
    near = (joint_distance(q, own, prismatic) < limit for own in q)
    return np.array([visits[some].sum() for some in near])
