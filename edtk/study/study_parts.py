"""Plans, tasks, prior, design space and robot that a study names."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from edtk.design.design_space import DesignSpace
from edtk.design.plan import REPEATS, Plan
from edtk.fit.correlated_noise import row_numbers
from edtk.fit.geometry.marker_positions import read_positions
from edtk.fit.prior import Normal, Prior
from edtk.measure.compliances import load_compliances
from edtk.measure.pose_table import (
    SHEET_COLUMNS,
    VISIT_COLUMN,
    WRENCH_COLUMNS,
    PoseTable,
    Table,
    finished_rows,
    of_file_units,
    path_of,
    pose_columns,
    with_own_headers,
)
from edtk.measure.task import Task, Tasks
from edtk.robots.constraints.excluded import Excluded
from edtk.robots.load_robot import load_robot
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.robots.loads.load import Load
from edtk.robots.robot import Robot
from edtk.robots.robot_file import RobotFileError, robot_from_dict
from edtk.robots.workspace import Workspace, within_margin
from edtk.study.check_study import check_limits
from edtk.study.schema import Specification
from edtk.study.study_model import marker_names, study_sigma, task_weights
from edtk.study.tables_of_task import TestPose
from edtk.system.errors import UserError, note
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    from edtk.study.study import Study
    from edtk.study.study_objects import StudyObjects

FEASIBLE = -1e-9  # least slack [m or rad] of a pose that counts as feasible, against rounding
MOST_POSES = 1000  # of a path that count; more would cost minutes, and tell no more
ASYMMETRY = 1e-6  # relative: printed digits of a covariance may differ by that
LEAST_STD = 1e-20  # [rad/(N m)]: a compliance that is known so well is no prior
TOO_CERTAIN = f"expected standard deviations of at least {LEAST_STD:g} rad/(N m)"
NO_VARIANCE = 2  # degrees of freedom up to which Student's t has no variance
KEY_OF_KIND = {"revolute": "limits_deg", "prismatic": "limits_mm"}
LINKS = ("base_link", "tip_link")


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


def study_tasks(study: "StudyObjects") -> Tasks:
    """The poses in which the robot shall be accurate, in their order; there may be none.

    Raises:
        UserError: The file of a path cannot be read, or has a pose that the robot cannot take;
            names the row and the column.
    """
    if study.specification.task is not None:
        return _of_file(study)
    return Tasks(_of_table(study, pose) for pose in study.specification.test_poses)


def _of_table(study: "StudyObjects", pose: TestPose) -> Task:
    """The task of one test pose."""
    return Task(
        q=of_file_units(study.robot, np.array(pose.q_deg)),
        tool=pose.tool.build(),
        wrench=pose.load.build(),
        robot=study.robot,
        unknown=study.unknown,
        within=float(np.deg2rad(pose.robust_deg)),
        lever=pose.lever_mm / 1e3,
        weight=pose.weight,
        dead_weights=task_weights(study, pose.payload),
    )


def _of_file(study: "StudyObjects") -> Tasks:
    """The tasks of a path, all with its tool, a row each; a long path is thinned, with a note."""
    given = study.specification.task
    assert given is not None
    load = None if given.load is None else given.load.build()
    path = study.folder / given.file
    plan = Plan.from_csv(path, study.robot, study.fixed, load)
    check_limits(study, plan.q)
    count = len(plan.q)
    rows = np.unique(np.linspace(0, count - 1, min(count, MOST_POSES)).round().astype(int))
    if len(rows) < count:
        note(
            f"{len(rows)} of {count} poses count, evenly spread from the first row to the last, "
            "and are numbered among themselves",
            path,
        )
    tool = given.tool.build()
    weights = task_weights(study, given.payload)
    return Tasks(
        Task(
            q=q,
            tool=tool,
            wrench=wrench,
            robot=study.robot,
            unknown=study.unknown,
            within=float(np.deg2rad(given.robust_deg)),
            lever=given.lever_mm / 1e3,
            dead_weights=weights,
        )
        for q, wrench in zip(plan.q[rows], plan.wrench[rows], strict=True)
    )


def study_prior(study: "Study") -> Prior:
    """Build the prior of a study's unknown compliances, which are positive, from its [prior] table.

    Raises:
        UserError: The table names another joint, its covariance is no covariance, or its file
            cannot be read.
    """
    table = study.specification.prior
    unknown = study.specification.joints.unknown
    for name in table.joints:
        if name not in unknown:
            message = f"{name!r} is no unknown joint; expected {', '.join(unknown)}"
            raise study.error("prior.joints", message)
    marginals = tuple(table.joints.get(name, table.all).build() for name in unknown)
    if table.earlier_file is not None:
        return Prior(marginals, _from_file(study, table.earlier_file))
    if table.earlier is not None:
        return Prior(marginals, _from_table(study))
    return Prior(marginals)


def _from_table(study: "Study") -> Normal:
    """The normal prior that the study's file states itself."""
    unknown = study.specification.joints.unknown
    earlier = study.specification.prior.earlier
    assert earlier is not None
    mean = earlier.mean_rad_per_Nm
    if set(mean) != set(unknown):
        message = f"expected one value each for {', '.join(unknown)}"
        raise study.error("prior.earlier.mean_rad_per_Nm", message)
    p = len(unknown)
    rows = earlier.covariance
    if len(rows) != p or any(len(row) != p for row in rows):
        message = f"expected {p} rows of {p} numbers, one per unknown joint"
        raise study.error("prior.earlier.covariance", message)
    covariance = np.array(rows)
    not_positive = study.error(
        "prior.earlier.covariance", "expected a symmetric, positive definite matrix"
    )
    if not np.allclose(covariance, covariance.T, rtol=ASYMMETRY, atol=0):
        raise not_positive
    if 0 < np.diag(covariance).min() < LEAST_STD**2:
        raise study.error("prior.earlier.covariance", TOO_CERTAIN)
    try:
        return Normal(np.array([mean[name] for name in unknown]), covariance)
    except np.linalg.LinAlgError:
        raise not_positive from None


def _from_file(study: "Study", name: str) -> Normal:
    """The result of an earlier calibration, as `edtk identify` has written it.

    Where sigma was estimated the covariance is widened to that of Student's t.
    """
    unknown = study.specification.joints.unknown
    key = "prior.earlier_file"
    try:
        found = load_compliances(study.folder / name, study.robot.joint_names, unknown)
    except UserError as error:
        place = name if error.key is None else f"{name}: {error.key}"
        raise study.error(key, f"{place}: {error.message}") from error
    not_positive = study.error(
        key, f"{name}: expected a positive definite covariance, or std, beside k"
    )
    if found.covariance is None:
        raise not_positive
    dof = found.covariance_dof
    if dof <= NO_VARIANCE:
        message = f"{name}: expected a covariance_dof above {NO_VARIANCE}, or no variance is finite"
        raise study.error(key, message)
    wider = dof / (dof - NO_VARIANCE) if np.isfinite(dof) else 1.0
    if 0 < np.diag(found.covariance).min() < LEAST_STD**2:
        raise study.error(key, f"{name}: {TOO_CERTAIN}")
    chosen = [found.joints.index(joint) for joint in unknown]
    try:
        return Normal(found.unbounded[chosen], wider * found.covariance[np.ix_(chosen, chosen)])
    except np.linalg.LinAlgError:
        raise not_positive from None


NO_WRENCH = np.zeros(6)  # of poses to stay away from, whatever their load


def study_space(study: "Study") -> DesignSpace:
    """Build the design space of a study: model, feasible set, noise, loads and free joints.

    Raises:
        UserError: A file of excluded poses cannot be read, or the study is about geometry too.
    """
    study.require_compliances_alone()
    return pose_space(study, study.specification.build_load())


def pose_space(study: "Study", load: Load) -> DesignSpace:
    """The same with loads of the caller's choice, whatever is unknown.

    Args:
        study: The study.
        load: The wrenches that may be applied.

    Raises:
        UserError: A file of excluded poses cannot be read.
    """
    fixed = study.fixed
    values = np.array([fixed.get(j, 0.0) for j in range(study.robot.n)])
    free = [j for j in range(study.robot.n) if j not in fixed]
    constraints = (*study.specification.workspace.build(), *_exclusions(study))
    workspace = Workspace(_within_margin(study), constraints)
    sigma = study_sigma(study)
    return DesignSpace(study.model, workspace, sigma, load, free, values, noise=study.noise)


def _within_margin(study: "Study") -> Robot:
    """The robot, whose joints keep their margin from the limits.

    Raises:
        UserError: A joint has no range left.
    """
    margin = study.specification.joints.margin()
    try:
        return within_margin(study.robot, margin, frozenset(study.fixed))
    except ValueError as error:
        raise study.error("joints.margin_deg", str(error)) from error


def _exclusions(study: "Study") -> list[Excluded]:
    """Distances from the poses that plans keep away from, a constraint for each file or plan."""
    workspace = study.specification.workspace
    plans = [read_plan(study, study.folder / name, NO_WRENCH) for name in workspace.excluded]
    if isinstance(study.excluded, Plan):
        plans.append(study.excluded)
    elif study.excluded is not None:
        plans.append(read_plan(study, study.excluded, NO_WRENCH))
    within = float(np.deg2rad(workspace.excluded_within_deg))
    return [Excluded(_distinct(plan.q), within) for plan in plans]


def _distinct(q: Array) -> Array:
    """Poses (m, n) without those that came before: a sheet has each as often as it was visited."""
    _, first = np.unique(q, axis=0, return_index=True)
    return q[np.sort(first)]


def study_robot(keys: Specification, folder: Path, where: str) -> Robot:
    """Find the robot of a study, with the limits that the study has in place of its own.

    Args:
        keys: The keys of the study.
        folder: Folder to which the path of a robot's file is relative.
        where: The study, for messages.

    Raises:
        UserError: One line that names the study, the key and what was expected.
    """
    try:
        robot = _found(keys, folder)
    except RobotFileError as error:
        if error.key in LINKS:
            message = error.message if error.where is None else f"{error.where} {error.message}"
            raise UserError(message, where=where, key=error.key) from error
        if error.key == "limits":
            raise UserError(str(error.message), where=where, key=_limits_key(keys)) from error
        raise UserError(str(error), where=where, key="robot") from error
    for kind, key in KEY_OF_KIND.items():
        for name in getattr(keys.joints, key):
            joint = robot.joints[robot.joint_names.index(name)]
            if joint.kind != kind:
                message = f"the joint is {joint.kind}; give its limits in {KEY_OF_KIND[joint.kind]}"
                raise UserError(message, where=where, key=f"joints.{key}.{name}")
    return robot


def _found(keys: Specification, folder: Path) -> Robot:
    limits = keys.joints.limits()
    if isinstance(keys.robot, str):
        return load_robot(keys.robot, folder, base=keys.base_link, tip=keys.tip_link, limits=limits)
    for key in LINKS:
        if getattr(keys, key) is not None:
            message = "goes with a URDF file; this robot is a table, which has no links"
            raise RobotFileError(message, key=key)
    try:
        return robot_from_dict(keys.robot).with_limits(limits)
    except RobotFileError:
        raise
    except ValueError as error:
        raise RobotFileError(str(error), key="limits") from error


def _limits_key(keys: Specification) -> str:
    """The key at which limits are wrong or missing."""
    return "joints.limits_mm" if keys.joints.limits_mm else "joints.limits_deg"


def prior_information(study: "Study") -> Array | None:
    """The precision of the Gaussian near the study's prior, which is added to that of a plan.

    An earlier calibration has the inverse of its covariance; a half-normal density of scale s has
    ``1/s^2``, and a log-normal one of median m and factor f has ``1/(m log f)^2``.

    Returns:
        Information (p, p); None unless `[prior] in_design` is set.

    Raises:
        UserError: The prior is not one, or says nothing.
    """
    if not study.specification.prior.in_design:
        return None
    precision, _ = study_prior(study).gaussian()
    if not np.asarray(precision).any():
        message = (
            "the prior says nothing about any compliance; expected an earlier calibration, or "
            "densities that are not flat"
        )
        raise study.error("prior.in_design", message)
    return precision
