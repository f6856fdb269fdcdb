"""The last step of a calibration: commands that keep the robot accurate under its task's load."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from edtk.design.plan import Plan
from edtk.inference.error_quantiles import error_quantiles
from edtk.model.all_compliances import all_compliances
from edtk.model.compensated_joints import compensated_joints
from edtk.model.compensation_accuracy import compensation_accuracy
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.equilibrium import NoEquilibriumError, equilibrium
from edtk.model.rigid_joints import rigid_joints, rigid_joints_in_words
from edtk.model.robot import Robot
from edtk.study.study import Study
from edtk.system.atomic_file import atomic_path
from edtk.system.errors import UserError
from edtk.system.presented import Presented
from edtk.tables.compliances import Compliances
from edtk.tables.pose_table import WRENCH_COLUMNS, PoseFileError, pose_columns, pose_factors

Array = NDArray[np.float64]
BAND = (0.025, 0.975)


@dataclass(frozen=True, eq=False)
class Compensation(Presented):
    """Commands for some task poses, and what is left of the error.

    Attributes:
        robot: The chain with the task's tool.
        desired: Joint variables (t, n) under load [rad or m].
        wrench: Task wrenches (t, 6) [N, N m].
        command: Joint variables (t, n) to command [rad or m].
        uncompensated: Distance (t,) of the loaded tool point from the desired one, were `desired` commanded [m].
        remaining: Root mean square (t,) of what errors of the compliances leave, Eq. (17) [m]; None if not known.
        band: Its 2.5 % and 97.5 % quantiles (t, 2) [m]; None if not known.
        rigid: Which joints count as rigid although the load turns them, in words.
        rho0_bias: What the linear model of the identification leaves beside it in the test pose [m]; None if not known.
    """

    robot: Robot
    desired: Array
    wrench: Array
    command: Array
    uncompensated: Array
    remaining: Array | None
    band: Array | None
    rho0_bias: float | None = None
    rigid: str = ""

    def headline(self) -> str:
        """Number of poses, and the largest error before and after."""
        before = f"{1e3 * self.uncompensated.max():.3g} mm"
        after = "an unknown error"
        if self.remaining is not None:
            after = f"{1e3 * self.remaining.max():.3g} mm"
        return f"{len(self.command)} task poses, from {before} at most down to {after}"

    def table(self) -> pd.DataFrame:
        """Commands, wrenches and errors: degrees, millimetres, newtons and newton metres."""
        table = pd.DataFrame(
            self.command / pose_factors(self.robot), columns=list(pose_columns(self.robot))
        )
        table[list(WRENCH_COLUMNS)] = self.wrench
        table["uncompensated_mm"] = 1e3 * self.uncompensated
        if self.remaining is not None and self.band is not None:
            table["remaining_rms_mm"] = 1e3 * self.remaining
            table[["remaining_low_mm", "remaining_high_mm"]] = 1e3 * self.band
        return table

    def to_csv(self, path: Path | str) -> None:
        """Write the table atomically."""
        with atomic_path(path) as temporary:
            self.table().to_csv(temporary, index=False, float_format="%.10g")

    def to_dict(self) -> list[dict[str, Any]]:
        """One object per task pose, in SI units, but `q_deg` in degrees and millimetres; what is not known is null."""
        degrees = self.command / pose_factors(self.robot)
        nothing = [None] * len(self.command)
        return [
            {
                "q": self.command[i].tolist(),
                "q_deg": degrees[i].tolist(),
                "desired_q": self.desired[i].tolist(),
                "wrench": self.wrench[i].tolist(),
                "uncompensated": float(self.uncompensated[i]),
                "remaining_rms": (nothing if self.remaining is None else self.remaining.tolist())[
                    i
                ],
                "remaining_band": (nothing if self.band is None else self.band.tolist())[i],
            }
            for i in range(len(self.command))
        ]


def load_task(study: Study, path: Path | str) -> Plan:
    """Read task poses, columns as in a plan; without wrench columns, the test pose's load acts.

    Joints that the study fixes may be left out, as in a plan. A column `repeats` means nothing here.

    Raises:
        UserError: The study has no test pose, or the file cannot be read; names the row and the column.
    """
    pose = study.specification.test_pose
    if pose is None:
        raise study.error(
            "test_pose",
            "expected a table with the tool and the load of the task, and there is none",
        )
    try:
        return Plan.from_csv(path, study.robot, study.fixed, pose.load.build())
    except PoseFileError as error:
        raise UserError(str(error)) from error


def compensate(study: Study, found: Compliances, task: Plan, path: Path) -> Compensation:
    """Commands for task poses with the test pose's tool, see `compensated_joints`, and the errors before and after.

    Joints without a compliance count as rigid. The error before is that of the loaded equilibrium; the error after,
    Eq. (17), is what errors of the compliances leave, to first order.

    Args:
        study: Robot and test pose.
        found: Compliances, perhaps with covariance.
        task: Desired poses and wrenches.
        path: Where the task comes from, for messages.

    Raises:
        UserError: The study has no test pose; or a desired or commanded pose is beyond a joint's limits, or buckles;
            names the row.
    """
    pose = study.specification.test_pose
    if pose is None:
        raise study.error(
            "test_pose", "expected a table with the tool of the task, and there is none"
        )
    robot = study.robot.with_tool(pose.tool.build())
    model = ElastostaticModel(robot, tuple(robot.joint_names.index(name) for name in found.joints))
    q = compensated_joints(model, task.q, task.wrench, found.k)
    _check_limits(robot, task.q, "desired", path)
    _check_limits(robot, q, "commanded", path)
    k = all_compliances(model, found.k)
    before = _rest(robot, task.q, task.wrench, k, path)
    after = q + _rest(robot, q, task.wrench, k, path)
    if len(lost := np.flatnonzero(np.abs(after - task.q).max(axis=-1) > 1e-8)):
        raise UserError(
            f"{path}: row {lost[0] + 1}: the load buckles the arm; expected a load that it can carry"
        )
    moved = robot.forward(task.q + before)[:, :3, 3] - robot.forward(task.q)[:, :3, 3]
    A, cov = model.regressor(task.q, task.wrench), found.covariance
    return Compensation(
        robot=robot,
        desired=task.q,
        wrench=task.wrench,
        command=q,
        uncompensated=np.linalg.norm(moved, axis=-1),
        remaining=None if cov is None else compensation_accuracy(A, cov),
        band=None if cov is None else error_quantiles(A, cov, BAND, found.covariance_dof),
        rho0_bias=found.rho0_bias,
        rigid=rigid_joints_in_words(rigid_joints(robot, task.q, task.wrench, found.joints)),
    )


def _rest(robot: Robot, q: Array, wrench: Array, k: Array, path: Path) -> Array:
    """Joint deflections (t, n) at rest; a pose that buckles is the task's mistake."""
    try:
        return equilibrium(robot, q, wrench, k).theta
    except NoEquilibriumError as error:
        raise UserError(
            f"{path}: row {error.pose + 1}: the load buckles the arm; expected a load that it can carry"
        ) from error


def _check_limits(robot: Robot, q: Array, which: str, path: Path) -> None:
    """Every pose is within the joints' limits."""
    lower, upper = robot.limits
    for row, j in np.argwhere((q < lower - 1e-9) | (q > upper + 1e-9)):
        factor, column = pose_factors(robot)[j], pose_columns(robot)[j]
        raise UserError(
            f"{path}: row {row + 1}, column {column}: the {which} value {q[row, j] / factor:.6g} is outside the "
            f"joint's limits {lower[j] / factor:.6g} .. {upper[j] / factor:.6g}"
        )
