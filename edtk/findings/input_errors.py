"""The first thing that is certainly wrong in measurements."""

import numpy as np

from edtk.findings.finding import Data, Finding, Severity, Wording
from edtk.findings.fitted_data import FittedData
from edtk.measure.pose_table import pose_columns, pose_factors

CHANCE = 1e-3  # probability of equal rows up to which they are copies


def copied_rows(fitted: FittedData) -> Finding | None:
    """Find rows that are the same, if they are more than coarse readings explain."""
    found = fitted.equal_rows
    if found is None or found.chance > CHANCE:
        return None
    return Finding.of(
        Severity.ALARM,
        WORDING,
        "copied_rows",
        rows=(found.later, found.earlier),
        others=found.others,
    )


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
    return Finding.of(
        Severity.ALARM,
        WORDING,
        "other_pose",
        rows=(row,),
        columns=(pose_columns(robot)[joint],),
        **data,
    )


def misread_columns(fitted: FittedData) -> Finding | None:
    """Find columns that fit if they are read otherwise, and do not as they are headed."""
    found = fitted.explanation
    return found.finding if found is not None and found.certain else None


def find_input_error(fitted: FittedData) -> Finding | None:
    """Find the first input error in measurements that can be read and fitted.

    Args:
        fitted: The measurements, their fit, and the plan that was to be carried out.

    Returns:
        The error, with its rows and columns; None if the measurements have none.
    """
    return other_pose(fitted) or copied_rows(fitted) or misread_columns(fitted)


def _other_pose(data: Data) -> str:
    """A measured pose that is not planned."""
    more = f"; {data['others']} more rows are not either" if data["others"] else ""
    return (
        f"row {data['rows'][0] + 1}, column {data['columns'][0]}: the pose is not in the plan; the "
        f"nearest planned one, row {data['nearest'] + 1}, is {data['distance']:.3g} "
        f"{data['unit']} away; expected {data['within']:.3g} at most (plan_resolution_deg in the "
        f"study's [workspace] allows more){more}"
    )


def twins(data: Data) -> str:
    """Rows that are the same."""
    later, earlier = data["rows"]
    others = data["others"]
    more = f", and {others} more rows have such a twin" if others else ""
    return f"row {later + 1} is row {earlier + 1} to the last digit, in all columns{more}"


def _copied_rows(data: Data) -> str:
    """Rows that were copied."""
    return f"{twins(data)}; expected measurements anew"


WORDING: Wording = {
    "other_pose": _other_pose,
    "copied_rows": _copied_rows,
}
