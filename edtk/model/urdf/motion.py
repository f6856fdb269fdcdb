"""The motion of a joint of a URDF file."""

import numpy as np

from edtk.model.transform import transform
from edtk.model.urdf.urdf import UrdfJoint
from edtk.system.typing import Array


def motion(joint: UrdfJoint, q: float) -> Array:
    """Transform (4, 4) from a joint's frame at zero to that at q [m].

    Args:
        joint: A joint; one that is neither prismatic nor turns does not move.
        q: Its variable [rad or m].
    """
    if not q or joint.kind not in ("revolute", "continuous", "prismatic"):
        return np.eye(4)
    axis = joint.axis / np.linalg.norm(joint.axis)
    if joint.kind == "prismatic":
        return transform(q * axis)
    from scipy.spatial.transform import Rotation

    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(q * axis).as_matrix()
    return T
