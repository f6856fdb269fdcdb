"""Commands that bring the markers where the robot of the drawing would have them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.geometry.marker_goal import FAR, MarkerGoal
from edtk.calibration.geometry.read_geometry import read_geometry
from edtk.design.plan import Plan
from edtk.inference.geometry.fitted_geometry import FittedGeometry, Loads
from edtk.model.robot import Robot
from edtk.study.study import Study
from edtk.system.atomic_file import write_text
from edtk.system.errors import UserError
from edtk.system.presented import Presented
from edtk.system.typing import Array
from edtk.tables.csv_text import csv_text
from edtk.tables.pose_columns import pose_columns
from edtk.tables.pose_table import WRENCH_COLUMNS, pose_factors
from edtk.tables.sheet_columns import (
    REMAINING_COLUMN,
    REMAINING_ROTATION_COLUMN,
    UNCOMPENSATED_COLUMN,
    UNCOMPENSATED_ROTATION_COLUMN,
)

if TYPE_CHECKING:
    import pandas as pd

MM = 1e3
DIGITS = 1e-4  # [rad or m] that a controller's display leaves out


@dataclass(frozen=True, eq=False)
class TurnErrors:
    """Errors of the orientations of markers.

    Attributes:
        uncompensated: Root mean square angle (t,) without compensation [rad].
        left: The same after compensation, by the identified model [rad].
        remaining: The same to expect after compensation [rad].
    """

    uncompensated: Array
    left: Array
    remaining: Array

    def to_dict(self) -> dict[str, Any]:
        """SI units."""
        return {
            "uncompensated": self.uncompensated.tolist(),
            "left": self.left.tolist(),
            "remaining": self.remaining.tolist(),
        }


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
        remaining: Root mean square distance (t,) to expect after compensation [m]: what is left,
            and what the calibration does not know.
        verdict: The verdict of the calibration; None where the result does not say.
        turns: The same errors of the markers' orientations; None where these were not measured.
    """

    robot: Robot
    desired: Array
    wrench: Array
    command: Array
    uncompensated: Array
    left: Array
    remaining: Array
    verdict: str | None = None
    turns: "TurnErrors | None" = None

    def headline(self) -> str:
        """How far off markers are before and after."""
        before = MM * float(self.uncompensated.max())
        after = MM * float(self.remaining.max())
        text = f"{len(self.desired)} commands, {before:.3g} mm off without, {after:.3g} with them"
        if self.turns is None:
            return text
        before, after = (
            float(np.rad2deg(one.max())) for one in (self.turns.uncompensated, self.turns.remaining)
        )
        return f"{text}; orientations {before:.3g} deg off without, {after:.3g} with them"

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
            **({} if self.turns is None else {"turns": self.turns.to_dict()}),
        }

    def to_frame(self) -> "pd.DataFrame":
        """A row for each command: joints in degrees and millimetres, wrench, errors [mm, deg]."""
        import pandas as pd

        shown = self.robot.shown(self.command) / pose_factors(self.robot)
        table = pd.DataFrame(shown, columns=list(pose_columns(self.robot)))
        for i, column in enumerate(WRENCH_COLUMNS):
            table[column] = self.wrench[:, i]
        table[UNCOMPENSATED_COLUMN] = MM * self.uncompensated
        table[REMAINING_COLUMN] = MM * self.remaining
        if self.turns is not None:
            table[UNCOMPENSATED_ROTATION_COLUMN] = np.rad2deg(self.turns.uncompensated)
            table[REMAINING_ROTATION_COLUMN] = np.rad2deg(self.turns.remaining)
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
    there, under the load of the pose, see `MarkerGoal`. Three markers fix position and orientation,
    one the position alone, unless its orientation was measured too.

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
    setting, fitted, counting = read_geometry(study, result["geometry"], where)
    if setting.full_poses and fitted.placed_turns is None:
        message = "the result is older than commands for full poses; identify the sheet anew"
        raise UserError(message, where=where, key="geometry.placed_turns_rad")
    desired = counting.turned(task.q)
    goal = MarkerGoal.of(fitted, desired)
    loads = setting.loads
    command = goal.commands(fitted, desired, task.wrench, loads)
    asked = counting.back(command)
    _require_reached(study.robot, asked, task.q, poses)
    plain, plain_turn = _errors(fitted, goal, desired, task.wrench, loads)
    left, left_turn = _errors(fitted, goal, command, task.wrench, loads)
    predicted = fitted.predict(command, task.wrench, loads)
    noise = fitted.noise
    turns = None
    if plain_turn is not None and left_turn is not None and predicted.turn_std is not None:
        remaining = _remaining(predicted.turn_std, (noise.turn or 0.0) / MM, left_turn)
        turns = TurnErrors(plain_turn, left_turn, remaining)
    verdict = result.get("verdict")
    return GeometricCompensation(
        robot=study.robot,
        desired=task.q,
        wrench=task.wrench,
        command=asked,
        uncompensated=plain,
        left=left,
        remaining=_remaining(predicted.std, noise.reading / MM, left),
        verdict=str(verdict) if isinstance(verdict, str) else None,
        turns=turns,
    )


def _errors(
    fitted: FittedGeometry,
    goal: MarkerGoal,
    q: Array,
    wrench: Array,
    loads: Loads | None,
) -> tuple[Array, Array | None]:
    """Root mean square distances [m] and angles [rad] of the markers (t,) from their goals."""
    torque = fitted.torque(q, wrench, loads)
    seen = fitted.model.see(fitted.theta, q, torque, derivatives=False)
    return goal.distance(seen), goal.angle(seen)


def _remaining(std: Array, reading: float, left: Array) -> Array:
    """Root mean square error (t,) of a marker, of all errors but a reading's.

    Args:
        std: Standard deviations (t, k, 3) of measured coordinates.
        reading: That of a reading.
        left: What the commands leave (t,), by the identified model.
    """
    squares = (std**2).sum(axis=-1).mean(axis=-1)
    return np.asarray(np.sqrt(np.maximum(squares - 3 * reading**2, 0.0) + left**2))


def _require_reached(robot: Robot, command: Array, desired: Array, where: Path | str) -> None:
    """Check that the search ended near each pose, within the joints' limits.

    Raises:
        UserError: It did not; names the row.
    """
    # A pose that is on a limit is so to the digits that a controller shows.
    _require_within(robot, desired, DIGITS, "{} of the pose is", where)
    near = np.abs(command - desired).max(axis=1) <= FAR
    far = np.flatnonzero(~near)
    if len(far):
        raise UserError(
            "no command near the pose brings the markers there; is the arm stretched?",
            where=where,
            key=f"row {far[0] + 1}",
        )
    _require_within(robot, command, 0.0, "the command of {} is", where)


def _require_within(robot: Robot, q: Array, by: float, what: str, where: Path | str) -> None:
    """Check that joint variables exceed no limit by more than something [rad or m].

    Raises:
        UserError: One does; names the row.
    """
    lower, upper = robot.hard_limits
    beyond = np.argwhere((q < lower - by) | (q > upper + by))
    if len(beyond):
        row, joint = beyond[0]
        message = f"{what.format(robot.joint_names[joint])} beyond the joint's limits"
        raise UserError(message, where=where, key=f"row {row + 1}")
