"""The last step of a calibration: commands that keep the robot accurate under its task's load."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from edtk.calibration.compensation import Compensation
from edtk.calibration.tools_of_task import ToolInUse, tools_of_task
from edtk.design.plan import Plan
from edtk.inference.error_quantiles import error_quantiles
from edtk.inference.offset_error_quantiles import offset_error_quantiles
from edtk.model.all_compliances import all_compliances
from edtk.model.compensated_joints import compensated_joints
from edtk.model.compensation_accuracy import compensation_accuracy
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.equilibrium import NoEquilibriumError, equilibrium
from edtk.model.remaining_error import remaining_error
from edtk.model.rigid_joints import rigid_joints
from edtk.model.robot import Robot
from edtk.model.shown_limit import shown_limits
from edtk.study.study import Study
from edtk.system.errors import UserError
from edtk.system.typing import Array, Indices
from edtk.tables.compliances import Compliances
from edtk.tables.pose_columns import pose_columns
from edtk.tables.pose_table import pose_factors

BAND = (0.025, 0.975)
ROUNDING = 1e-9  # [rad or m]: a joint at its very limit counts as within
SETTLED = 1e-8  # [rad or m]: an arm that settles farther from the desired joints has buckled


@dataclass(frozen=True)
class _Source:
    """Where task poses come from, for messages.

    Attributes:
        path: The file, or the study.
        rows: The row (t,) of each pose there, counted from 0.
    """

    path: Path | str
    rows: Indices

    def error(self, message: str, pose: int, column: str = "") -> UserError:
        """An error in one pose, to be raised."""
        key = f"row {self.rows[pose] + 1}{column}"
        return UserError(message, where=self.path, key=key)

    def buckles(self, pose: int) -> UserError:
        """The error of a pose that cannot carry its load."""
        return self.error("the load buckles the arm; expected a load that it can carry", pose)


def compensate(
    study: Study, found: Compliances, task: Plan, path: Path | str, own: bool = False
) -> Compensation:
    """Compute commands for task poses with the test pose's tool, and the errors before and after.

    Joints that have a compliance neither here nor among the known ones of the study count as rigid.
    The error before is that of the loaded equilibrium;
    the error after, Eq. (17), is the one that errors of the compliances leave, to first order.

    Args:
        study: Robot and test poses.
        found: Compliances, perhaps with covariance.
        task: Desired poses and wrenches.
        path: Where the task comes from, for messages.
        own: Whether these are the study's own test poses, each with its own tool and payload.

    Raises:
        UserError: The study has no test pose, or some with different tools that are not its own
            poses; or a desired or commanded pose is beyond a joint's limits, or buckles; names the
            row.
    """
    found = found.including(study.specification.joints.known_rad_per_Nm)
    tools = tools_of_task(study, len(task.q), own)
    turned = any(one.lever for one in study.tasks)
    parts = [_with_tool(tool, found, task, path, turned) for tool in tools]
    return Compensation.joined(parts, [tool.rows for tool in tools])


def _with_tool(
    tool: ToolInUse, found: Compliances, every: Plan, path: Path | str, turned: bool
) -> Compensation:
    """The commands for the poses of one tool."""
    rows = tool.rows
    task = Plan(every.q[rows], every.wrench[rows], every.repeats[rows])
    source = _Source(path, rows)
    robot = tool.robot
    joints = tuple(map(robot.joint_names.index, found.joints))
    model = ElastostaticModel(robot, joints, weights=tool.weights)
    q = compensated_joints(model, task.q, task.wrench, found.k)
    _require_within_limits(robot, task.q, "desired", source)
    _require_within_limits(robot, q, "commanded", source)
    k = all_compliances(model, found.k)
    uncompensated = _uncompensated(model, task, k, source)
    _require_settled(model, task, q, k, source)
    offset = _offset(model, task, found, source)
    remaining, band = _errors_after(model, task, found, offset)
    return Compensation(
        robot=robot,
        desired=task.q,
        wrench=task.wrench,
        command=q,
        uncompensated=uncompensated,
        remaining=remaining,
        band=band,
        linear=None if offset is None else np.linalg.norm(offset, axis=-1),
        rho0_bias=found.rho0_bias,
        verdict=found.verdict,
        rigid_joints=rigid_joints(model, task.q, task.wrench, found.joints),
        rotation=_rotation_after(model, task, found) if turned else None,
    )


def _uncompensated(model: ElastostaticModel, task: Plan, k: Array, source: _Source) -> Array:
    """Distance (t,) of the loaded tool point from the desired one without compensation [m]."""
    loaded = task.q + _deflection(model, task.q, task.wrench, k, source)
    moved = model.robot.forward(loaded)[:, :3, 3] - model.robot.forward(task.q)[:, :3, 3]
    return np.linalg.norm(moved, axis=-1)


def _offset(
    model: ElastostaticModel, task: Plan, found: Compliances, source: _Source
) -> Array | None:
    """Mean error (t, 3) that the bias of the linear model leaves, at rest [m].

    The robot whose compliances are those identified, less the bias, is commanded by the identified
    ones. None where the file does not know the bias, or has no covariance to go with it.

    Raises:
        UserError: A pose buckles; names its row.
    """
    if found.bias is None or found.covariance is None:
        return None
    likely = np.maximum(found.k - found.bias, 0.0)
    try:
        return remaining_error(model, task.q, task.wrench, found.k, likely)
    except NoEquilibriumError as error:
        raise source.buckles(error.pose) from error


def _errors_after(
    model: ElastostaticModel, task: Plan, found: Compliances, offset: Array | None
) -> tuple[Array | None, Array | None]:
    """Root mean square (t,) and band (t, 2) of the errors that wrong compliances leave [m]."""
    if found.covariance is None:
        return None, None
    A = model.regressor(task.q, task.wrench)
    noise = compensation_accuracy(A, found.covariance)
    if offset is None:
        return noise, error_quantiles(A, found.covariance, BAND, found.covariance_dof)
    band = offset_error_quantiles(A, found.covariance, offset, BAND, found.covariance_dof)
    return np.hypot(noise, np.linalg.norm(offset, axis=-1)), band


def _rotation_after(model: ElastostaticModel, task: Plan, found: Compliances) -> Array | None:
    """Root mean square (t,) of the rotations that wrong compliances leave, to first order [rad]."""
    if found.covariance is None:
        return None
    A = replace(model, rows="pose").regressor(task.q, task.wrench)[:, 3:]
    noise = compensation_accuracy(A, found.covariance)
    return noise if found.bias is None else np.hypot(noise, np.linalg.norm(A @ found.bias, axis=-1))


def _require_settled(
    model: ElastostaticModel, task: Plan, q: Array, k: Array, source: _Source
) -> None:
    """Check that the loaded robot comes to rest in the desired joints.

    Raises:
        UserError: A pose buckles; names its row.
    """
    loaded = q + _deflection(model, q, task.wrench, k, source)
    lost = np.flatnonzero(np.abs(loaded - task.q).max(axis=-1) > SETTLED)
    if len(lost):
        raise source.buckles(int(lost[0]))


def _deflection(
    model: ElastostaticModel, q: Array, wrench: Array, k: Array, source: _Source
) -> Array:
    """Joint deflections (t, n) at rest.

    Raises:
        UserError: A pose buckles; names its row.
    """
    try:
        return equilibrium(model.robot, q, wrench, k, loading=model.loading).theta
    except NoEquilibriumError as error:
        raise source.buckles(error.pose) from error


def _require_within_limits(robot: Robot, q: Array, which: str, source: _Source) -> None:
    """Check that every pose (t, n) is within the joints' limits.

    Raises:
        UserError: A pose is not; names row and column.
    """
    lower, upper = robot.hard_limits
    outside = np.argwhere((q < lower - ROUNDING) | (q > upper + ROUNDING))
    if not len(outside):
        return
    row, j = outside[0]
    factor = pose_factors(robot)[j]
    shown = shown_limits(robot)[j]
    low, high = shown.range((lower[j], upper[j]))
    of = "" if shown.label == robot.joint_names[j] else f" of {shown.label}"
    raise source.error(
        f"the {which} value {shown.of(q[row, j]) / factor:.6g}{of} is outside the joint's limits "
        f"{low / factor:.6g} .. {high / factor:.6g}",
        int(row),
        f", column {pose_columns(robot)[j]}",
    )
