"""The last step of a calibration: commands that keep the robot accurate under its task's load."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from edtk.calibration.compensation import Compensation
from edtk.calibration.refused_rows import RefusedRow, RefusedRowsError, require_one
from edtk.calibration.task_doubts import task_doubts
from edtk.calibration.tools_of_task import ToolInUse, tools_of_task
from edtk.design.plan import Plan
from edtk.inference.error_quantiles import error_quantiles
from edtk.inference.offset_error_quantiles import offset_error_quantiles
from edtk.model.all_compliances import all_compliances
from edtk.model.assumed_joint import AssumedJoint
from edtk.model.compensated_joints import compensated_joints
from edtk.model.compensation_accuracy import compensation_accuracy
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.equilibrium import NoEquilibriumError, equilibrium
from edtk.model.remaining_error import remaining_error
from edtk.model.rigid_joints import rigid_joints
from edtk.model.robot import Robot
from edtk.model.shown_limit import shown_limits
from edtk.study.assumed_joints import assumed_joints
from edtk.study.study import Study
from edtk.system.typing import Array, Indices
from edtk.tables.compliances import Compliances
from edtk.tables.pose_columns import pose_columns
from edtk.tables.pose_table import pose_factors

BAND = (0.025, 0.975)
ROUNDING = 1e-9  # [rad or m]: a joint at its very limit counts as within
BUCKLES = "the load buckles the arm; expected a load that it can carry"
SETTLED = 1e-8  # [rad or m]: an arm that settles farther from the desired joints has buckled


def compensate(
    study: Study, found: Compliances, task: Plan, path: Path | str, own: bool = False
) -> Compensation:
    """Compute commands for task poses with the test pose's tool, and the errors before and after.

    Rows that have no answer are left out, and named in the result.
    Joints that have a compliance neither here nor among the known ones of the study count as rigid.
    The error before is that of the loaded equilibrium. The error after is the total of the error
    budget: what errors of the compliances leave, Eq. (17), by the noise and by all else that is
    uncertain in the calibration, and what joints that are not identified add, to first order.

    Args:
        study: Robot and test poses.
        found: Compliances, perhaps with covariance.
        task: Desired poses and wrenches.
        path: Where the task comes from, for messages.
        own: Whether these are the study's own test poses, each with its own tool and payload.

    Raises:
        UserError: The study has no test pose, or some with different tools that are not its own
            poses; or every desired or commanded pose is beyond a joint's limits, or buckles; names
            the first row.
    """
    taken = _Taken.of(study, found)
    turned = any(one.lever for one in study.tasks)
    parts: list[Compensation] = []
    refused: list[RefusedRow] = []
    tools = tools_of_task(study, len(task.q), own)
    doubts = task_doubts(study, found, task)
    for tool in tools:
        part, left_out = _with_tool(tool, taken, task, turned)
        refused += left_out
        parts += [] if part is None else [part]
    if doubts and not parts:
        refused = [replace(row, reason=f"{row.reason}; {doubts[0]}") for row in refused]
    require_one(len(parts), refused, path)
    joined = Compensation.joined(parts, sorted(refused, key=lambda row: row.row))
    return replace(joined, doubts=doubts)


@dataclass(frozen=True, eq=False)
class _Taken:
    """The compliances by which commands are made.

    Attributes:
        identified: Those that were identified, with their covariance by the noise.
        every: The same with those of all other joints, and with all that is uncertain.
    """

    identified: Compliances
    every: Compliances

    @classmethod
    def of(cls, study: Study, found: Compliances) -> "_Taken":
        """With what the study takes of joints that were not identified."""
        given = dict(zip(found.joints, found.k, strict=True))
        k = np.array([given.get(name, 0.0) for name in study.specification.joints.unknown])
        return cls(found, found.including(assumed_joints(study, k)))


def _with_tool(
    tool: ToolInUse, found: _Taken, task: Plan, turned: bool
) -> tuple[Compensation | None, list[RefusedRow]]:
    """The commands for the poses of one tool that have one; None if no pose has."""
    rows = tool.rows
    refused: list[RefusedRow] = []
    while len(rows):
        try:
            return _commands(tool, rows, found, task, turned), refused
        except RefusedRowsError as error:
            bad = [int(rows[one.row]) for one in error.rows]
            refused += [replace(one, row=row) for one, row in zip(error.rows, bad, strict=True)]
            rows = np.setdiff1d(rows, bad)
    return None, refused


def _commands(
    tool: ToolInUse, rows: Indices, taken: _Taken, every: Plan, turned: bool
) -> Compensation:
    """The commands for some poses.

    Raises:
        RefusedRowsError: Some of them have none; rows are counted among these.
    """
    task = Plan(every.q[rows], every.wrench[rows], every.repeats[rows])
    found = taken.every
    robot = tool.robot
    joints = tuple(map(robot.joint_names.index, found.joints))
    model = ElastostaticModel(robot, joints, weights=tool.weights)
    q = compensated_joints(model, task.q, task.wrench, found.k)
    _require_within_limits(robot, task.q, "desired")
    _require_within_limits(robot, q, "commanded")
    k = all_compliances(model, found.k)
    with _buckling_rows():
        uncompensated = _uncompensated(model, task, k)
        _require_settled(model, task, q, k)
        offset = _offset(model, task, found)
    known = tuple(robot.joint_names[j] for j in joints if k[j])
    after = _errors_after(model, task, taken, offset)
    return Compensation(
        robot=robot,
        desired=task.q,
        wrench=task.wrench,
        command=q,
        uncompensated=uncompensated,
        remaining=None if after is None else after.total,
        band=None if after is None else after.band,
        linear=None if offset is None else np.linalg.norm(offset, axis=-1),
        rho0_bias=found.rho0_bias,
        verdict=found.verdict,
        rigid_joints=rigid_joints(model, task.q, task.wrench, (*taken.identified.joints, *known)),
        rotation=_rotation_after(model, task, found) if turned else None,
        rows=rows,
        by_noise=None if after is None else after.by_noise,
        by_joints=() if after is None else after.by_joints,
    )


@contextmanager
def _buckling_rows() -> Iterator[None]:
    """Name the poses that do not come to rest.

    Raises:
        RefusedRowsError: Some do not.
    """
    try:
        yield
    except NoEquilibriumError as error:
        raise RefusedRowsError([RefusedRow(pose, BUCKLES) for pose in error.poses]) from error


def _uncompensated(model: ElastostaticModel, task: Plan, k: Array) -> Array:
    """Distance (t,) of the loaded tool point from the desired one without compensation [m].

    Raises:
        NoEquilibriumError: A pose buckles.
    """
    loaded = task.q + _deflection(model, task.q, task.wrench, k)
    moved = model.robot.forward(loaded)[:, :3, 3] - model.robot.forward(task.q)[:, :3, 3]
    return np.linalg.norm(moved, axis=-1)


def _offset(model: ElastostaticModel, task: Plan, found: Compliances) -> Array | None:
    """Mean error (t, 3) that the bias of the linear model leaves, at rest [m].

    The robot whose compliances are those identified, less the bias, is commanded by the identified
    ones. None where the file does not know the bias, or has no covariance to go with it.

    Raises:
        NoEquilibriumError: A pose buckles.
    """
    if found.bias is None or found.covariance is None:
        return None
    likely = np.maximum(found.k - found.bias, 0.0)
    return remaining_error(model, task.q, task.wrench, found.k, likely)


@dataclass(frozen=True, eq=False)
class _After:
    """Errors in task poses after compensation, root mean squares [m].

    Attributes:
        total: By all that is uncertain (t,).
        band: Its 95 % band (t, 2).
        by_noise: By the noise of the measurements (t,).
        by_joints: By each joint that is not identified (t,).
    """

    total: Array
    band: Array
    by_noise: Array
    by_joints: tuple[tuple[AssumedJoint, Array], ...]


def _errors_after(
    model: ElastostaticModel, task: Plan, taken: _Taken, offset: Array | None
) -> _After | None:
    """The errors that wrong compliances leave; None where nothing is known of them."""
    identified, found = taken.identified, taken.every
    if found.covariance is None or identified.covariance is None:
        return None
    A = model.regressor(task.q, task.wrench)
    p = len(identified.joints)
    total = compensation_accuracy(A, found.covariance)
    noise = compensation_accuracy(A[..., :p], identified.covariance)
    each = [
        (
            one.joint,
            np.linalg.norm(A[..., :p] @ one.shifts - A[..., p + j] * one.joint.std, axis=-1),
        )
        for j, one in enumerate(found.assumed)
    ]
    dof = _degrees_of_freedom(found.covariance_dof, total, noise)
    if offset is None:
        return _After(total, error_quantiles(A, found.covariance, BAND, dof), noise, tuple(each))
    band = offset_error_quantiles(A, found.covariance, offset, BAND, dof)
    return _After(np.hypot(total, np.linalg.norm(offset, axis=-1)), band, noise, tuple(each))


def _degrees_of_freedom(dof: float, total: Array, noise: Array) -> float:
    """Those of the total (Satterthwaite), as only the noise is estimated; least of all poses."""
    share = np.divide(noise, total, out=np.ones_like(total), where=total > 0)
    most = float(share.max(initial=0.0))
    return dof / most**4 if most > 0 else np.inf


def _rotation_after(model: ElastostaticModel, task: Plan, found: Compliances) -> Array | None:
    """Root mean square (t,) of the rotations that wrong compliances leave, to first order [rad]."""
    if found.covariance is None:
        return None
    A = replace(model, rows="pose").regressor(task.q, task.wrench)[:, 3:]
    noise = compensation_accuracy(A, found.covariance)
    return noise if found.bias is None else np.hypot(noise, np.linalg.norm(A @ found.bias, axis=-1))


def _require_settled(model: ElastostaticModel, task: Plan, q: Array, k: Array) -> None:
    """Check that the loaded robot comes to rest in the desired joints.

    Raises:
        NoEquilibriumError: A pose buckles.
    """
    loaded = q + _deflection(model, q, task.wrench, k)
    lost = np.flatnonzero(np.abs(loaded - task.q).max(axis=-1) > SETTLED)
    if len(lost):
        raise NoEquilibriumError(lost.tolist())


def _deflection(model: ElastostaticModel, q: Array, wrench: Array, k: Array) -> Array:
    """Joint deflections (t, n) at rest.

    Raises:
        NoEquilibriumError: A pose buckles.
    """
    return equilibrium(model.robot, q, wrench, k, loading=model.loading).theta


def _require_within_limits(robot: Robot, q: Array, which: str) -> None:
    """Check that every pose (t, n) is within the joints' limits.

    Raises:
        RefusedRowsError: Some are not; names the first joint of each.
    """
    lower, upper = robot.hard_limits
    outside = (q < lower - ROUNDING) | (q > upper + ROUNDING)
    factors = pose_factors(robot)
    columns = pose_columns(robot)
    refused = []
    for row in np.flatnonzero(outside.any(axis=1)):
        j = int(np.argmax(outside[row]))
        shown = shown_limits(robot)[j]
        low, high = shown.range((lower[j], upper[j]))
        of = "" if shown.label == robot.joint_names[j] else f" of {shown.label}"
        reason = (
            f"the {which} value {shown.of(q[row, j]) / factors[j]:.6g}{of} is outside the joint's "
            f"limits {low / factors[j]:.6g} .. {high / factors[j]:.6g}"
        )
        refused.append(RefusedRow(int(row), reason, columns[j]))
    if refused:
        raise RefusedRowsError(refused)
