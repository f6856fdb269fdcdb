"""Measured poses that are not planned."""

import numpy as np

from edtk.calibration.finding import Finding, Kind
from edtk.calibration.fitted_data import FittedData
from edtk.tables.pose_columns import pose_columns
from edtk.tables.pose_table import pose_factors


def other_pose(fitted: FittedData) -> Finding | None:
    """Find the first measured pose that is not planned, and the column that is farthest off."""
    match = fitted.match
    if fitted.plan is None or match is None:
        return None
    rows = np.flatnonzero(match.distance > match.within)
    if not len(rows):
        return None
    robot = fitted.study.robot
    row = int(rows[0])
    nearest = int(match.pose[row])
    change = robot.shown_change(fitted.data.q[row] - fitted.plan.q[nearest])
    off = np.abs(change) / pose_factors(robot)
    joint = int(off.argmax())
    data = {
        "nearest": nearest,
        "distance": float(match.distance[row]),
        "within": match.within,
        "unit": "mm" if robot.joints[joint].kind == "prismatic" else "deg",
        "others": len(rows) - 1,
    }
    return Finding(Kind.OTHER_POSE, (row,), (pose_columns(robot)[joint],), data=data)
