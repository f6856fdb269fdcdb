"""Commands that bring the markers where the robot of the drawing would have them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.geometry.geometry_to_dict import geometry_of_dict
from edtk.calibration.geometry.study_geometry import StudyGeometry
from edtk.design.plan import Plan
from edtk.inference.geometry.geometric_fit import FittedGeometry, Loads
from edtk.model.robot import Robot
from edtk.study.study import Study
from edtk.system.atomic_file import write_text
from edtk.system.errors import UserError
from edtk.system.presented import Presented
from edtk.system.typing import Array
from edtk.tables.csv_text import csv_text
from edtk.tables.pose_columns import pose_columns
from edtk.tables.pose_table import WRENCH_COLUMNS, pose_factors

if TYPE_CHECKING:
    import pandas as pd

MM = 1e3
STEPS = 30  # of Newton's method; four are the rule
SETTLED = 1e-9  # [m] a step that moves no marker by more ends the search
SINGULAR = 1e-4  # of the largest singular value: smaller ones of a Jacobian are not used
FAR = 0.2  # [rad or m] a correction is never so large


@dataclass(frozen=True, eq=False)
class GeometricCompensation(Presented):
    """Commands for some poses of the drawing's robot, with the errors before and after.

    Attributes:
        robot: The drawing.
        desired: Joint variables (t, n) of the poses, as the study counts them [rad or m].
        wrench: Forces and torques (t, 6) in them [N, N m].
        command: Joint variables (t, n) to command [rad or m].
        uncompensated: Root mean square distance (t,) of the markers, were `desired` commanded [m].
        left: The same after compensation, by the identified model [m].
        remaining: Standard deviation (t,) of a marker's distance after compensation [m].
        verdict: The verdict of the calibration; None where the result does not say.
    """

    robot: Robot
    desired: Array
    wrench: Array
    command: Array
    uncompensated: Array
    left: Array
    remaining: Array
    verdict: str | None = None

    def headline(self) -> str:
        """How far off markers are before and after."""
        before = MM * float(self.uncompensated.max())
        after = MM * float(self.remaining.max())
        return f"{len(self.desired)} commands, {before:.3g} mm off without, {after:.3g} with them"

    def to_dict(self) -> dict[str, Any]:
        """SI units."""
        return {
            "joints": list(self.robot.joint_names),
            "desired": self.robot.shown(self.desired).tolist(),
            "command": self.robot.shown(self.command).tolist(),
            "wrench": self.wrench.tolist(),
            "uncompensated": self.uncompensated.tolist(),
            "left": self.left.tolist(),
            "remaining": self.remaining.tolist(),
            "verdict": self.verdict,
        }

    def to_frame(self) -> "pd.DataFrame":
        """A row for each command: joints in degrees and millimetres, wrench, errors [mm]."""
        import pandas as pd

        shown = self.robot.shown(self.command) / pose_factors(self.robot)
        table = pd.DataFrame(shown, columns=list(pose_columns(self.robot)))
        for i, column in enumerate(WRENCH_COLUMNS):
            table[column] = self.wrench[:, i]
        table["uncompensated_mm"] = MM * self.uncompensated
        table["remaining_rms_mm"] = MM * self.remaining
        return table

    def to_csv(self, path: Path | str) -> None:
        """Write `to_frame` to a file, whole or not at all."""
        write_text(path, csv_text(self.to_frame()))


def compensate_geometry(
    study: Study, result: Mapping[str, Any], where: Path | str, task: Plan, poses: Path | str
) -> GeometricCompensation:
    """Find commands that carry the markers where the drawing's robot carries them.

    The robot of the drawing stands where it fitted the positions best, with the markers where they
    fitted best, and moves without a load. A command q of the identified robot brings its markers
    there, under the load of the pose: ``sum_i |x_i(q) - y_i|^2`` is least, by Newton's method with
    the smallest steps (Gauss-Newton with a pseudo-inverse). Three markers fix position and
    orientation, one the position alone.

    Args:
        study: A study with [parameters].
        result: The result of its calibration, with the table `geometry`.
        where: The result, for messages.
        task: Poses and wrenches.
        poses: Their file, for messages.

    Raises:
        UserError: The result is of another study, or a pose cannot be reached, or the commands are
            beyond the joints' limits; names the row.
    """
    setting = StudyGeometry.of_result(study, result["geometry"].get("markers"))
    setting.require_positions("a compensation")
    try:
        fitted, counting = geometry_of_dict(result["geometry"], setting)
    except ValueError as error:
        raise UserError(str(error), where=where, key="geometry") from error
    desired = counting.turned(task.q)
    goal = _goal(fitted, desired)
    loads = setting.loads
    command = _command(fitted, desired, task.wrench, loads, goal)
    left = _distance(fitted, command, task.wrench, loads, goal)
    plain = _distance(fitted, desired, task.wrench, loads, goal)
    asked = counting.back(command)
    _require_reached(study.robot, asked, task.q, poses)
    verdict = result.get("verdict")
    return GeometricCompensation(
        robot=study.robot,
        desired=task.q,
        wrench=task.wrench,
        command=asked,
        uncompensated=plain,
        left=left,
        remaining=_remaining(fitted, command, task.wrench, loads),
        verdict=str(verdict) if isinstance(verdict, str) else None,
    )


def _goal(fitted: FittedGeometry, q: Array) -> Array:
    """Where the drawing's robot carries the markers (t, k, 3) [m]."""
    drawing = replace(fitted.model, parameters=(), offsets=fitted.placed)
    return drawing.see(np.zeros(0), q, derivatives=False).points


def _command(
    fitted: FittedGeometry, desired: Array, wrench: Array, loads: Loads | None, goal: Array
) -> Array:
    """Commands (t, n) by Newton's method."""
    q = desired.copy()
    for _ in range(STEPS):
        seen = fitted.model.see(fitted.theta, q, fitted.torque(q, wrench, loads))
        assert seen.by_joints is not None
        t, n = q.shape
        J = seen.by_joints.reshape(t, -1, n)
        apart = (goal - seen.points).reshape(t, -1, 1)
        step = (np.linalg.pinv(J, rcond=SINGULAR) @ apart)[..., 0]
        step = np.clip(step, -FAR, FAR)
        q = q + step
        if np.abs(J @ step[..., None]).max(initial=0.0) < SETTLED:
            break
    return q


def _distance(
    fitted: FittedGeometry, q: Array, wrench: Array, loads: Loads | None, goal: Array
) -> Array:
    """Root mean square distance (t,) of the markers from their goals [m]."""
    torque = fitted.torque(q, wrench, loads)
    points = fitted.model.see(fitted.theta, q, torque, derivatives=False).points
    return np.asarray(np.sqrt(((points - goal) ** 2).sum(axis=-1).mean(axis=-1)))


def _remaining(fitted: FittedGeometry, q: Array, wrench: Array, loads: Loads | None) -> Array:
    """Standard deviation (t,) of a marker's distance, all errors but a reading's [m]."""
    predicted = fitted.predict(q, wrench, loads)
    squares = (predicted.std**2).sum(axis=-1).mean(axis=-1)
    reading = 3 * (fitted.noise.reading / MM) ** 2
    return np.asarray(np.sqrt(np.maximum(squares - reading, 0.0)))


def _require_reached(robot: Robot, command: Array, desired: Array, where: Path | str) -> None:
    """Check that the search ended near each pose, within the joints' limits.

    Raises:
        UserError: It did not; names the row.
    """
    far = np.flatnonzero(np.abs(command - desired).max(axis=1) > FAR)
    if len(far):
        raise UserError(
            "no command near the pose brings the markers there; is the arm stretched?",
            where=where,
            key=f"row {far[0] + 1}",
        )
    lower, upper = robot.hard_limits
    beyond = np.argwhere((command < lower) | (command > upper))
    if len(beyond):
        row, joint = beyond[0]
        name = robot.joint_names[joint]
        message = f"the command of {name} is beyond the joint's limits"
        raise UserError(message, where=where, key=f"row {row + 1}")
