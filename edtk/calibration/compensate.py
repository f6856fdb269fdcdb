"""The last step of a calibration: commands that keep the robot accurate under its task's load."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.robot_of_task import robot_of_task, weights_of_task
from edtk.design.plan import Plan
from edtk.inference.error_quantiles import error_quantiles
from edtk.inference.offset_error_quantiles import offset_error_quantiles
from edtk.model.all_compliances import all_compliances
from edtk.model.compensated_joints import compensated_joints
from edtk.model.compensation_accuracy import compensation_accuracy
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.equilibrium import NoEquilibriumError, equilibrium
from edtk.model.remaining_error import remaining_error
from edtk.model.rigid_joints import rigid_joints, rigid_joints_in_words
from edtk.model.robot import Robot
from edtk.model.shown_limit import shown_limits
from edtk.study.study import Study
from edtk.system.atomic_file import write_text
from edtk.system.errors import UserError
from edtk.system.presented import Presented
from edtk.system.typing import Array
from edtk.tables.compliances import Compliances
from edtk.tables.csv_text import csv_text
from edtk.tables.pose_columns import pose_columns
from edtk.tables.pose_table import WRENCH_COLUMNS, pose_factors
from edtk.tables.sheet_columns import (
    BAND_COLUMNS,
    REMAINING_COLUMN,
    REMAINING_ROTATION_COLUMN,
    UNCOMPENSATED_COLUMN,
)

if TYPE_CHECKING:
    import pandas as pd

BAND = (0.025, 0.975)
ROUNDING = 1e-9  # [rad or m]: a joint at its very limit counts as within
SETTLED = 1e-8  # [rad or m]: an arm that settles farther from the desired joints has buckled


@dataclass(frozen=True, eq=False)
class Compensation(Presented):
    """Commands for some task poses, with the errors before and after.

    Attributes:
        robot: The chain with the task's tool.
        desired: Joint variables (t, n) under load [rad or m].
        wrench: Task wrenches (t, 6) [N, N m].
        command: Joint variables (t, n) to command [rad or m].
        uncompensated: Distance (t,) of the loaded tool point from the desired one, were `desired`
            commanded [m].
        remaining: Root mean square (t,) of the error that wrong compliances leave, Eq. (17), with
            that of the linear model where it is known [m]; None if it is not known.
        band: Its 2.5 % and 97.5 % quantiles (t, 2) [m]; None if they are not known.
        linear: Length (t,) of the mean error by which identifying with the linear model is off
            [m]; None if it is not known, and then not part of the others.
        rho0_bias: The same in the test pose [m]; None if it is not known.
        rigid: Which joints count as rigid although the load turns them, in words.
        verdict: "good", "usable" or "bad", as the identification rated the compliances; None if it
            is not known.
        rotation: Root mean square (t,) of the rotation that wrong compliances leave [rad]; None
            unless the test pose has a lever at which rotations count, or if it is not known.
    """

    robot: Robot
    desired: Array
    wrench: Array
    command: Array
    uncompensated: Array
    remaining: Array | None
    band: Array | None
    linear: Array | None = None
    rho0_bias: float | None = None
    rigid: str = ""
    verdict: str | None = None
    rotation: Array | None = None

    def headline(self) -> str:
        """Number of poses, and the largest error before and after."""
        before = f"{1e3 * self.uncompensated.max():.3g} mm"
        after = "unknown"
        if self.remaining is not None:
            after = f"{1e3 * self.remaining.max():.3g} mm"
        return f"{len(self.command)} task poses, largest error {before} before, {after} after"

    def to_frame(self) -> "pd.DataFrame":
        """Commands, wrenches and errors: degrees, millimetres, newtons and newton metres."""
        import pandas as pd

        degrees = self.robot.shown(self.command) / pose_factors(self.robot)
        table = pd.DataFrame(degrees, columns=list(pose_columns(self.robot)))
        table[list(WRENCH_COLUMNS)] = self.wrench
        table[UNCOMPENSATED_COLUMN] = 1e3 * self.uncompensated
        if self.remaining is not None and self.band is not None:
            table[REMAINING_COLUMN] = 1e3 * self.remaining
            table[list(BAND_COLUMNS)] = 1e3 * self.band
        if self.rotation is not None:
            table[REMAINING_ROTATION_COLUMN] = np.rad2deg(self.rotation)
        return table

    def to_csv(self, path: Path | str) -> None:
        """Write the table to a file, whole or not at all, or to standard output (`-`)."""
        write_text(path, csv_text(self.to_frame()))

    def to_dict(self) -> list[dict[str, Any]]:
        """One object per task pose, in SI units, but `q_deg` in degrees and millimetres.

        An error that is not known is null.
        """
        degrees = self.robot.shown(self.command) / pose_factors(self.robot)
        unknown = [None] * len(self.command)
        remaining = unknown if self.remaining is None else self.remaining.tolist()
        band = unknown if self.band is None else self.band.tolist()
        linear = unknown if self.linear is None else self.linear.tolist()
        rotation = [] if self.rotation is None else self.rotation.tolist()
        return [
            {
                "q": self.command[i].tolist(),
                "q_deg": degrees[i].tolist(),
                "desired_q": self.desired[i].tolist(),
                "wrench": self.wrench[i].tolist(),
                "uncompensated": float(self.uncompensated[i]),
                "remaining_rms": remaining[i],
                "remaining_band": band[i],
                "linear_model": linear[i],
                **({"remaining_rotation_rms": rotation[i]} if rotation else {}),
            }
            for i in range(len(self.command))
        ]


def compensate(study: Study, found: Compliances, task: Plan, path: Path | str) -> Compensation:
    """Compute commands for task poses with the test pose's tool, and the errors before and after.

    Joints that have a compliance neither here nor among the known ones of the study count as rigid.
    The error before is that of the loaded equilibrium;
    the error after, Eq. (17), is the one that errors of the compliances leave, to first order.

    Args:
        study: Robot and test pose.
        found: Compliances, perhaps with covariance.
        task: Desired poses and wrenches.
        path: Where the task comes from, for messages.

    Raises:
        UserError: The study has no test pose, or some with different tools; or a desired or
            commanded pose is beyond a joint's limits, or buckles; names the row.
    """
    found = found.including(study.specification.joints.known_rad_per_Nm)
    robot = robot_of_task(study)
    joints = tuple(map(robot.joint_names.index, found.joints))
    model = ElastostaticModel(robot, joints, weights=weights_of_task(study))
    q = compensated_joints(model, task.q, task.wrench, found.k)
    _require_within_limits(robot, task.q, "desired", path)
    _require_within_limits(robot, q, "commanded", path)
    k = all_compliances(model, found.k)
    uncompensated = _uncompensated(model, task, k, path)
    _require_settled(model, task, q, k, path)
    offset = _offset(model, task, found, path)
    remaining, band = _errors_after(model, task, found, offset)
    turned = any(one.lever for one in study.tasks)
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
        rigid=rigid_joints_in_words(rigid_joints(model, task.q, task.wrench, found.joints)),
        rotation=_rotation_after(model, task, found) if turned else None,
    )


def _uncompensated(model: ElastostaticModel, task: Plan, k: Array, path: Path | str) -> Array:
    """Distance (t,) of the loaded tool point from the desired one without compensation [m]."""
    loaded = task.q + _deflection(model, task.q, task.wrench, k, path)
    moved = model.robot.forward(loaded)[:, :3, 3] - model.robot.forward(task.q)[:, :3, 3]
    return np.linalg.norm(moved, axis=-1)


def _offset(
    model: ElastostaticModel, task: Plan, found: Compliances, path: Path | str
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
        raise _buckles(path, error.pose) from error


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
    model: ElastostaticModel, task: Plan, q: Array, k: Array, path: Path | str
) -> None:
    """Check that the loaded robot comes to rest in the desired joints.

    Raises:
        UserError: A pose buckles; names its row.
    """
    loaded = q + _deflection(model, q, task.wrench, k, path)
    lost = np.flatnonzero(np.abs(loaded - task.q).max(axis=-1) > SETTLED)
    if len(lost):
        raise _buckles(path, lost[0])


def _deflection(
    model: ElastostaticModel, q: Array, wrench: Array, k: Array, path: Path | str
) -> Array:
    """Joint deflections (t, n) at rest.

    Raises:
        UserError: A pose buckles; names its row.
    """
    try:
        return equilibrium(model.robot, q, wrench, k, loading=model.loading).theta
    except NoEquilibriumError as error:
        raise _buckles(path, error.pose) from error


def _buckles(path: Path | str, row: int) -> UserError:
    """The error of a pose that cannot carry its load."""
    message = "the load buckles the arm; expected a load that it can carry"
    return UserError(message, where=path, key=f"row {row + 1}")


def _require_within_limits(robot: Robot, q: Array, which: str, path: Path | str) -> None:
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
    raise UserError(
        f"the {which} value {shown.of(q[row, j]) / factor:.6g}{of} is outside the joint's limits "
        f"{low / factor:.6g} .. {high / factor:.6g}",
        where=path,
        key=f"row {row + 1}, column {pose_columns(robot)[j]}",
    )
