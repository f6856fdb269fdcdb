"""Plans, and sheets as plans, that are read for a study."""

import numpy as np

from edtk.design.plan import REPEATS, Plan
from edtk.fit.correlated_noise import row_numbers
from edtk.measure.pose_table import (
    LOAD_COLUMNS,
    SHEET_COLUMNS,
    WRENCH_COLUMNS,
    PoseTable,
    Table,
    path_of,
    pose_columns,
    with_own_headers,
)
from edtk.robots.workspace import Workspace
from edtk.study.study_objects import StudyObjects
from edtk.system.errors import UserError
from edtk.system.typing import Array, Indices

FEASIBLE = -1e-9  # least slack [m or rad] of a pose that counts as feasible, against rounding


def load_plan(study: StudyObjects, path: Table, made: bool = False) -> Plan:
    """Read a plan, or the experiments of a sheet; check each pose against limits and workspace.

    A pose counts as feasible if one within the study's `plan_resolution_deg` of it is, since
    published poses are rounded. Excluded poses are feasible too: they may have been measured, and
    are only not to be planned.

    Args:
        study: The study.
        path: The plan's file (CSV), or a data frame that holds what it would.
        made: Whether of a sheet only the rows that are filled in count, and one has to be.

    Raises:
        UserError: Names the file and the row.
    """
    plan = _of_sheet(study, path, made)
    if plan is None:
        plan = Plan.from_csv(path, study.robot, study.fixed, study.kind.wrench_of_pose(study))
    revolute = np.array([joint.kind == "revolute" for joint in study.robot.joints])
    resolution = np.deg2rad(study.specification.workspace.plan_resolution_deg) * revolute
    workspace = Workspace(study.robot, study.specification.workspace.build())
    slack = workspace.slack_within(plan.q, resolution)
    outside = (slack < FEASIBLE).any(axis=1)
    if outside.any():
        row = int(outside.argmax())
        broken = "; ".join(map(str, workspace.violations(slack[row])))
        raise UserError(f"the pose violates {broken}", where=path_of(path), key=f"row {row + 1}")
    return plan


def _of_sheet(study: StudyObjects, path: Table, made: bool) -> Plan | None:
    """The experiments of a measurement sheet; None for a plan.

    Rows of one visit are one experiment.

    Args:
        study: The study.
        path: The sheet, or a plan.
        made: Whether only rows that are filled in count.

    Raises:
        UserError: Names the file and the row or column; or no row is filled in.
    """
    table = PoseTable.read(path, "plan")
    if not is_sheet(study, table):
        return None
    return _counted(*study.kind.visits(study, path, table, made))


def is_sheet(study: StudyObjects, table: PoseTable) -> bool:
    """Whether a table has columns for measurements; a plan has none."""
    own = {*pose_columns(study.robot), *WRENCH_COLUMNS, *LOAD_COLUMNS, REPEATS}
    header = with_own_headers([str(name) for name in table.cells], study.robot, SHEET_COLUMNS)
    return REPEATS not in table and not set(header) <= own


def firsts(number: Indices, *columns: Array) -> tuple[Array, ...]:
    """The first rows of each number (m,) of columns (m, c)."""
    first = np.unique(number, return_index=True)[1]
    return tuple(column[first] for column in columns)


def _counted(q: Array, wrench: Array) -> Plan:
    """A plan in which each pose and load is there once, with its repetitions."""
    number = row_numbers(q, wrench)
    poses, loads = firsts(number, q, wrench)
    return Plan(poses, loads, np.bincount(number))
