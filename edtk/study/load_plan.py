"""Plans from files, checked against a study."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.design.plan import REPEATS, Plan
from edtk.inference.geometry.read_positions import read_positions
from edtk.inference.row_numbers import row_numbers
from edtk.model.loads.fixed_load import FixedLoad
from edtk.model.workspace import Workspace
from edtk.study.study_model import marker_names
from edtk.system.errors import UserError
from edtk.system.note import note
from edtk.system.typing import Array, Indices
from edtk.tables.finished_rows import finished_rows
from edtk.tables.pose_columns import pose_columns, with_own_headers
from edtk.tables.pose_table import WRENCH_COLUMNS, PoseTable, Table, path_of
from edtk.tables.sheet_columns import SHEET_COLUMNS, VISIT_COLUMN

if TYPE_CHECKING:
    from edtk.study.study import Study

FEASIBLE = -1e-9  # least slack [m or rad] of a pose that counts as feasible, against rounding


def load_plan(study: "Study", path: Table, made: bool = False) -> Plan:
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
    plan = _of_sheet(study, path, made) or read_plan(study, path, _default_wrench(study))
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


def _default_wrench(study: "Study") -> Array | None:
    """The wrench (6,) of a pose whose row says none: the study's only load; none of geometry."""
    if study.specification.parameters is not None:
        return np.zeros(6)
    load = study.space.load
    return load.always if isinstance(load, FixedLoad) else None


def _of_sheet(study: "Study", path: Table, made: bool) -> Plan | None:
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
    own = {*pose_columns(study.robot), *WRENCH_COLUMNS, REPEATS}
    header = with_own_headers([str(name) for name in table.cells], study.robot, SHEET_COLUMNS)
    if REPEATS in table or set(header) <= own:
        return None
    if study.specification.parameters is not None:
        q, wrench = _visits_of_positions(study, path, made)
    else:
        table = table.with_known(study.robot, SHEET_COLUMNS)
        table = finished_rows(table) if made else table
        q = table.poses(study.robot, study.fixed)
        wrench = table.wrenches(_default_wrench(study))
        if VISIT_COLUMN in table:
            visit = row_numbers(q, wrench, table.numbers(VISIT_COLUMN)[:, None])
            q, wrench = _firsts(visit, q, wrench)
    return _counted(q, wrench)


def _visits_of_positions(study: "Study", path: Table, made: bool) -> tuple[Array, Array]:
    """Poses (v, n) and loads (v, 6) of the visits of a sheet of positions.

    Raises:
        UserError: The sheet cannot be read, or no visit is made.
    """
    names = marker_names(study)
    turned = names if study.specification.measurement.rows == "pose" else ()
    data = read_positions(path, study.robot, study.fixed, names, measured=False, turned=turned)
    if not made:
        return data.q, data.wrench
    seen = data.seen.any(axis=1)
    if not seen.any():
        raise UserError("no position of a marker is filled in", where=path_of(path))
    if not seen.all():
        note(f"{int(seen.sum())} of {len(data)} visits are filled in", path_of(path))
    return data.q[seen], data.wrench[seen]


def _firsts(number: Indices, *columns: Array) -> tuple[Array, ...]:
    """The first rows of each number (m,) of columns (m, c)."""
    first = np.unique(number, return_index=True)[1]
    return tuple(column[first] for column in columns)


def _counted(q: Array, wrench: Array) -> Plan:
    """A plan in which each pose and load is there once, with its repetitions."""
    number = row_numbers(q, wrench)
    poses, loads = _firsts(number, q, wrench)
    return Plan(poses, loads, np.bincount(number))


def read_plan(study: "Study", path: Table, wrench: Array | None) -> Plan:
    """Read a plan whose poses are not checked.

    Args:
        study: The study, which names the columns and gives the values of fixed joints.
        path: The plan's file (CSV), or a data frame that holds what it would.
        wrench: Default wrench (6,) [N, N m]; None if the file must say which forces are applied.

    Raises:
        UserError: Names the file and the row or column.
    """
    return Plan.from_csv(path, study.robot, study.fixed, wrench)
