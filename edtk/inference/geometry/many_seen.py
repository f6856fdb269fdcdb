"""What is measured of the markers for many sets of parameters at once."""

import numpy as np

from edtk.model.geometry.geometric_model import GeometricModel, Seen
from edtk.model.geometry.rotation import rotation
from edtk.system.typing import Array


def many_seen(model: GeometricModel, theta: Array, q: Array, torque: Array | None = None) -> Seen:
    """What `GeometricModel.see` predicts, for each of many sets of parameters.

    Args:
        model: The model.
        theta: Parameters (w, p) in SI units.
        q: Joint variables (m, n) [rad or m].
        torque: Loads (m, n) of the free joints [N m or N]; None for none.

    Returns:
        Positions (w, m, k, 3) in the frame of the instrument [m], and orientations
        (w, m, k, 3, 3), none (0,) where positions alone are measured. No derivatives.
    """
    base, errors, tools, softness = model.motions_of_many(theta)
    robot = model.robot
    w = len(theta)
    bent = np.broadcast_to(q, (w, *q.shape))
    if torque is not None:
        bent = q + softness[:, None] * torque
    variables = model.chain.variables(bent.reshape(-1, q.shape[1])).reshape(w, len(q), -1)
    R = np.broadcast_to(robot.base[:3, :3], (w, len(q), 3, 3))
    p = np.broadcast_to(robot.base[:3, 3], (w, len(q), 3))
    for j, joint in enumerate(robot.chain):
        p = p + R @ joint.origin[:3, 3]
        R = R @ joint.origin[:3, :3]
        p = p + (R @ errors[:, None, j, :3, None])[..., 0]
        R = R @ rotation(errors[:, j, 3:])[:, None]
        if model.chain.slides[j]:
            p = p + variables[..., j, None] * (R @ joint.axis)
        else:
            R = R @ rotation(variables[..., j, None] * joint.axis)
    p = p + R @ robot.tool[:3, 3]
    R = R @ robot.tool[:3, :3]
    local = model.offsets + tools[..., :3]
    points = p[:, :, None] + np.einsum("wmij,wkj->wmki", R, local)
    B = model.start[:3, :3] @ rotation(base[:, 3:])
    origin = model.start[:3, 3] + base[:, :3] @ model.start[:3, :3].T
    turns = np.zeros(0)
    if model.rows == "pose":
        turns = (B[:, None] @ R)[:, :, None] @ rotation(tools[..., 3:])[:, None]
    return Seen(origin[:, None, None] + np.einsum("wij,wmkj->wmki", B, points), turns)
