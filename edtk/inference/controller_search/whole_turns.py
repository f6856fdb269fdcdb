"""Joints of which a whole turn makes no difference."""

import numpy as np

from edtk.model.robot import Robot
from edtk.system.typing import Mask

ROUNDING = 1e-9  # of a factor that counts as whole


def whole_turns(robot: Robot) -> Mask:
    """Mask (n,) of the joints of which a whole turn leaves the arm as it is.

    Joints that turn are of this kind, unless another one slides with them, or turns by a broken
    share of their angle.
    """
    found = np.array([joint.kind != "prismatic" for joint in robot.joints])
    for tied in robot.tied:
        broken = abs(tied.factor - round(tied.factor)) > ROUNDING
        if broken or tied.kind == "prismatic":
            found[robot.joint_names.index(tied.master)] = False
    return found
