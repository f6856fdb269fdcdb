"""What a result of geometry must have in common with a study that reads it."""

import numpy as np

from edtk.calibration.geometry.study_geometry import StudyGeometry
from edtk.system.typing import Array

STEP = 0.1  # [rad or m]: the mark's pose has its joints at 1, 2, 3, ... steps
WRENCH = np.array([100.0, 200.0, 300.0, 10.0, 20.0, 30.0])  # [N, N m]: any one that is not zero


def study_marks(setting: StudyGeometry) -> dict[str, Array]:
    """Numbers that differ where a study counts its joints, or loads them, in another way.

    Predictions rest on more than a result holds: on the controller's signs and zeros, on the place
    where a load acts, and on the weights of payload and links. What these do in one pose is written
    beside the result, so that a study that was changed since is not answered with wrong numbers.

    Returns:
        `shown`: what the controller shows in a pose (n,) [rad or m]; `loads`: loads (2, n) of the
        joints there without a wrench and under one [N m or N], where springs are asked for.
    """
    robot = setting.study.robot
    q = STEP * np.arange(1.0, robot.n + 1)
    marks = {"shown": np.asarray(robot.shown(q))}
    if setting.loads is not None:
        marks["loads"] = setting.loads(np.stack([q, q]), np.stack([0 * WRENCH, WRENCH]))
    return marks
