"""Commands that bring the markers where the robot of the drawing would have them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.geometry.marker_goal import FAR, MarkerGoal
from edtk.calibration.geometry.read_geometry import read_geometry
from edtk.calibration.refused_rows import RefusedRow, require_one
from edtk.design.plan import Plan
from edtk.inference.geometry.fitted_geometry import FittedGeometry, Loads
from edtk.model.robot import Robot
from edtk.study.study import Study
from edtk.system.atomic_file import write_text
from edtk.system.errors import UserError
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices, Mask
from edtk.tables.csv_text import csv_text
from edtk.tables.pose_columns import pose_columns
from edtk.tables.pose_table import WRENCH_COLUMNS, pose_factors
from edtk.tables.sheet_columns import (
    REMAINING_COLUMN,
    REMAINING_ROTATION_COLUMN,
    ROW_COLUMN,
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
        rows: Rows (t,) of the task that these are, counted from 0.
        refused: Rows of the task that have no answer.
    """

    robot: Robot
    desired: Array
    wrench: Array
    command: Array
    uncompensated: Array
    left: Array
    remaining: Array
    rows: Indices
    verdict: str | None = None
    turns: "TurnErrors | None" = None
    refused: tuple[RefusedRow, ...] = ()

    def headline(self) -> str:
        """How far off markers are before and after."""
        before = MM * float(self.uncompensated.max())
        after = MM * float(self.remaining.max())
        left_out = f" ({len(self.refused)} rows left out)" if self.refused else ""
        commands = f"{len(self.desired)} commands{left_out}"
        text = f"{commands}, {before:.3g} mm off without, {after:.3g} with them"
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
            "rows": (self.rows + 1).tolist(),
            "left_out": [row.to_dict() for row in self.refused],
            **({} if self.turns is None else {"turns": self.turns.to_dict()}),
        }

    def to_frame(self) -> "pd.DataFrame":
        """A row for each command: joints in degrees and millimetres, wrench, errors [mm, deg].

        Where rows of the task are left out, the first column is the row there.
        """
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
        if self.refused:
            table.insert(0, ROW_COLUMN, self.rows + 1)
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
    one the position alone, unless its orientation was measured too. Rows that have no command are
    left out, and named in the result.

    Args:
        study: A study with [parameters].
        result: The result of its calibration, with the table `geometry`.
        where: The result, for messages.
        task: Poses and wrenches.
        poses: Their file, for messages.

    Raises:
        UserError: The result is of another study, or no pose can be reached within the joints'
            limits; names the first row.
    """
    setting, fitted, counting = read_geometry(study, result["geometry"], where)
    if setting.full_poses and fitted.placed_turns is None:
        message = "the result is older than commands for full poses; identify the sheet anew"
        raise UserError(message, where=where, key="geometry.placed_turns_rad")
    loads = setting.loads
    every = counting.turned(task.q)
    goal = MarkerGoal.of(fitted, every)
    command = goal.commands(fitted, every, task.wrench, loads)
    refused = _not_reached(study.robot, counting.back(command), task.q)
    rows = np.setdiff1d(np.arange(len(every)), [row.row for row in refused])
    require_one(len(rows), refused, poses)
    goal = goal.of_poses(rows)
    desired, command, wrench = every[rows], command[rows], task.wrench[rows]
    plain, plain_turn = _errors(fitted, goal, desired, wrench, loads)
    left, left_turn = _errors(fitted, goal, command, wrench, loads)
    predicted = fitted.predict(command, wrench, loads)
    noise = fitted.noise
    turns = None
    if plain_turn is not None and left_turn is not None and predicted.turn_std is not None:
        remaining = _remaining(predicted.turn_std, (noise.turn or 0.0) / MM, left_turn)
        turns = TurnErrors(plain_turn, left_turn, remaining)
    verdict = result.get("verdict")
    return GeometricCompensation(
        robot=study.robot,
        desired=task.q[rows],
        wrench=wrench,
        command=counting.back(command),
        uncompensated=plain,
        left=left,
        remaining=_remaining(predicted.std, noise.reading / MM, left),
        verdict=str(verdict) if isinstance(verdict, str) else None,
        turns=turns,
        rows=rows,
        refused=tuple(refused),
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


def _not_reached(robot: Robot, command: Array, desired: Array) -> list[RefusedRow]:
    """Poses at which the search did not end nearby, within the joints' limits.

    Args:
        robot: Has the limits.
        command: Joint variables (t, n) where the search ended [rad or m].
        desired: Joint variables (t, n) where it began.
    """
    lower, upper = robot.hard_limits
    # A pose that is on a limit is so to the digits that a controller shows.
    asked = (desired < lower - DIGITS) | (desired > upper + DIGITS)
    near: Mask = np.abs(command - desired).max(axis=1) <= FAR
    answered = (command < lower) | (command > upper)
    refused = []
    for row in np.flatnonzero(asked.any(axis=1) | ~near | answered.any(axis=1)):
        if asked[row].any():
            reason = f"{_first(robot, asked[row])} of the pose is beyond the joint's limits"
        elif not near[row]:
            reason = "no command near the pose brings the markers there; is the arm stretched?"
        else:
            reason = f"the command of {_first(robot, answered[row])} is beyond the joint's limits"
        refused.append(RefusedRow(int(row), reason))
    return refused


def _first(robot: Robot, which: Mask) -> str:
    """The first joint of some."""
    return robot.joint_names[int(np.argmax(which))]
