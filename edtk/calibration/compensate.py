"""The last step of a calibration: commands that keep the robot accurate under its task's load."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.prediction import DISPLAYED, Prediction
from edtk.calibration.tasks_in_use import (
    RefusedRow,
    RefusedRowsError,
    ToolInUse,
    require_one,
    task_findings,
    tools_of_task,
)
from edtk.design.plan import Plan
from edtk.findings.finding import Finding
from edtk.findings.prior import unstated_findings
from edtk.fit.distributions import BAND, NormalMixture
from edtk.measure.cells import csv_text
from edtk.measure.equilibrium import NoEquilibriumError
from edtk.measure.expected_error import AssumedJoint
from edtk.measure.pose_table import (
    BAND_COLUMNS,
    PART_COLUMNS,
    REMAINING_COLUMN,
    REMAINING_ROTATION_COLUMN,
    ROW_COLUMN,
    UNCOMPENSATED_COLUMN,
    UNCOMPENSATED_ROTATION_COLUMN,
    WRENCH_COLUMNS,
    Table,
    pose_columns,
    pose_factors,
)
from edtk.measure.task import RigidJoint, rigid_joints_in_words
from edtk.robots.joint import AT_LIMIT
from edtk.robots.robot import Beyond, Robot
from edtk.study.study import Study
from edtk.system.files import write_text
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd

NO_COMMAND = "no command near the pose brings the markers there; is the arm stretched?"


@dataclass(frozen=True, eq=False)
class Compensation(Presented):
    """Commands for some task poses, with the errors before and after.

    Errors are of the loaded tool point, or where geometry was identified root mean squares of the
    markers, which the robot of the drawing would carry to their goals.

    Attributes:
        robot: The chain with the task's tool; of several tools with the first one's.
        desired: Joint variables (t, n) under load [rad or m].
        wrench: Task wrenches (t, 6) [N, N m].
        command: Joint variables (t, n) to command [rad or m].
        uncompensated: Error (t,), were `desired` commanded, with what joints that count as rigid
            are assumed to bend [m].
        remaining: Root mean square (t,) of the error that is left in all: by wrong parameters, Eq.
            (17), whatever made them wrong, by joints that are not identified, by the linear model
            where that is known, and by what a model of geometry leaves out [m]; None if it is not
            known.
        band: From the 2.5 % quantile of the error by the noise alone to the 97.5 % quantile of that
            by all (t, 2) [m]; None if they are not known.
        rows: Rows (t,) of the task that these are, counted from 0.
        linear: Length (t,) of the mean error by which identifying with the linear model is off
            [m]; None if it is not known, and then not part of the others.
        rho0_bias: The same in the test pose [m]; None if it is not known.
        rigid_joints: Joints that count as rigid although the load turns them.
        verdict: "good", "usable" or "bad", as the identification rated the result; None if it is
            not known.
        rotation: Root mean square (t,) of the rotation that is left [rad]; None unless rotations
            count in the task or were measured, or if it is not known.
        refused: Rows of the task that have no answer.
        by_noise: What the noise of the measurements alone makes of it (t,) [m]; None likewise.
        by_joints: Joints that are assumed or known, and what each makes of it (t,) [m].
        findings: What looks like another unit in the task or the compliances.
        left: Error (t,) of the markers that the commands leave by the identified model, as an arm
            of few joints does [m]; None of the tool point.
        rotation_before: Root mean square (t,) of the markers' rotation, were `desired` commanded
            [rad]; None where it was not measured.
        rotation_left: The same with the commands, by the identified model [rad].
    """

    robot: Robot
    desired: Array
    wrench: Array
    command: Array
    uncompensated: Array
    remaining: Array | None
    band: Array | None
    rows: Indices
    linear: Array | None = None
    rho0_bias: float | None = None
    rigid_joints: tuple[RigidJoint, ...] = ()
    verdict: str | None = None
    rotation: Array | None = None
    refused: tuple[RefusedRow, ...] = ()
    by_noise: Array | None = None
    by_joints: tuple[tuple[AssumedJoint, Array], ...] = ()
    findings: tuple[Finding, ...] = ()
    left: Array | None = None
    rotation_before: Array | None = None
    rotation_left: Array | None = None

    @classmethod
    def joined(
        cls, parts: "Sequence[Compensation]", refused: Sequence[RefusedRow]
    ) -> "Compensation":
        """The commands for several tools, each in its own rows.

        Args:
            parts: Commands for each tool, of the same compliances.
            refused: Rows without commands.
        """
        first = parts[0]
        order = np.argsort(np.concatenate([part.rows for part in parts]))
        columns: dict[str, Any] = {}
        for name, value in vars(first).items():
            if isinstance(value, np.ndarray):
                each = [getattr(part, name) for part in parts]
                known = all(one is not None for one in each)
                columns[name] = np.concatenate(each)[order] if known else None
        every = [joint for part in parts for joint in part.rigid_joints]
        most = {one.name: one for one in sorted(every, key=lambda one: one.displacement)}
        return replace(
            first,
            **columns,
            rigid_joints=tuple(most[name] for name in first.robot.joint_names if name in most),
            refused=tuple(refused),
            by_joints=tuple(
                (joint, np.concatenate([part.by_joints[j][1] for part in parts])[order])
                for j, (joint, _) in enumerate(first.by_joints)
            ),
        )

    @property
    def by_assumed(self) -> Array:
        """What joints that are not identified make of the remaining error, together (t,) [m]."""
        squares = [error**2 for _, error in self.by_joints]
        return np.sqrt(np.sum(squares, axis=0)) if squares else np.zeros(len(self.command))

    @property
    def rigid(self) -> str:
        """Which joints count as rigid although the load turns them, in words."""
        return rigid_joints_in_words(self.rigid_joints)

    def headline(self) -> str:
        """Number of poses, and the largest error before and after."""
        before = f"{1e3 * self.uncompensated.max():.3g} mm"
        after = "unknown"
        if self.remaining is not None:
            after = f"{1e3 * self.remaining.max():.3g} mm"
        left_out = f" ({len(self.refused)} left out)" if self.refused else ""
        poses = f"{len(self.command)} task pose{'s' * (len(self.command) != 1)}{left_out}"
        text = f"{poses}, largest error {before} before, {after} after"
        if self.rotation is None or self.rotation_before is None:
            return text
        turned = np.rad2deg([self.rotation_before.max(), self.rotation.max()])
        return f"{text}; of rotations {turned[0]:.3g} deg before, {turned[1]:.3g} deg after"

    def to_frame(self) -> "pd.DataFrame":
        """Commands, wrenches and errors: degrees, millimetres, newtons and newton metres.

        Where rows of the task are left out, the first column is the row there.
        """
        import pandas as pd

        degrees = self.robot.shown(self.command) / pose_factors(self.robot)
        table = pd.DataFrame(degrees, columns=list(pose_columns(self.robot)))
        table[list(WRENCH_COLUMNS)] = self.wrench
        table[UNCOMPENSATED_COLUMN] = 1e3 * self.uncompensated
        if self.remaining is not None:
            table[REMAINING_COLUMN] = 1e3 * self.remaining
        if self.band is not None:
            table[list(BAND_COLUMNS)] = 1e3 * self.band
        if self.by_noise is not None:
            table[list(PART_COLUMNS)] = 1e3 * np.stack([self.by_noise, self.by_assumed], axis=1)
        if self.rotation_before is not None:
            table[UNCOMPENSATED_ROTATION_COLUMN] = np.rad2deg(self.rotation_before)
        if self.rotation is not None:
            table[REMAINING_ROTATION_COLUMN] = np.rad2deg(self.rotation)
        if self.refused:
            table.insert(0, ROW_COLUMN, self.rows + 1)
        return table

    def to_csv(self, path: Path | str) -> None:
        """Write the table to a file, whole or not at all, or to standard output (`-`)."""
        write_text(path, csv_text(self.to_frame()))

    def to_dict(self) -> list[dict[str, Any]] | dict[str, Any]:
        """SI units; an error that is not known is null. Rows are those of the task, from 1.

        Errors of the tool point are one object per task pose, in which `q_deg` is in degrees and
        millimetres, and rows that are left out are not. Errors of the markers are a list a
        quantity.
        """
        if self.left is None:
            return self._by_pose()
        turns = {
            "uncompensated": self.rotation_before,
            "left": self.rotation_left,
            "remaining": self.rotation,
        }
        return {
            "joints": list(self.robot.joint_names),
            "desired": self.robot.shown(self.desired).tolist(),
            "command": self.robot.shown(self.command).tolist(),
            "wrench": self.wrench.tolist(),
            "uncompensated": self.uncompensated.tolist(),
            "left": self.left.tolist(),
            "remaining": _listed(self.remaining, len(self.command)),
            "remaining_band": _listed(self.band, len(self.command)),
            "verdict": self.verdict,
            "rows": (self.rows + 1).tolist(),
            "left_out": [row.to_dict() for row in self.refused],
            **(
                {}
                if self.rotation is None
                else {"turns": {name: _listed(one, 0) for name, one in turns.items()}}
            ),
        }

    def _by_pose(self) -> list[dict[str, Any]]:
        """The errors of the tool point, one object per task pose."""
        t = len(self.command)
        assumed = None if self.by_noise is None else self.by_assumed
        columns: dict[str, list[Any]] = {
            "row": (self.rows + 1).tolist(),
            "q": self.command.tolist(),
            "q_deg": (self.robot.shown(self.command) / pose_factors(self.robot)).tolist(),
            "desired_q": self.desired.tolist(),
            "wrench": self.wrench.tolist(),
            "uncompensated": self.uncompensated.tolist(),
            "remaining_rms": _listed(self.remaining, t),
            "remaining_band": _listed(self.band, t),
            "linear_model": _listed(self.linear, t),
            "remaining_by_noise": _listed(self.by_noise, t),
            "remaining_by_assumed_joints": _listed(assumed, t),
        }
        if self.rotation is not None:
            columns["remaining_rotation_rms"] = self.rotation.tolist()
        return [dict(zip(columns, one, strict=True)) for one in zip(*columns.values(), strict=True)]


def _listed(values: Array | None, count: int) -> list[Any]:
    """Numbers for JSON; as many nulls where they are not known."""
    return [None] * count if values is None else list(values.tolist())


class Calibrated(ABC):
    """A robot as a calibration has found it, whatever its parameters are.

    Attributes:
        study: The study of the calibration.
    """

    study: Study

    @property
    @abstractmethod
    def compliances(self) -> Mapping[str, float]:
        """Compliances by joint [rad/(N m)]."""

    def tools(self, poses: int, own: bool) -> tuple[ToolInUse, ...]:
        """The tools in which task poses are meant, see `tools_of_task`."""
        return tools_of_task(self.study, poses, own)

    @abstractmethod
    def with_tool(self, tool: ToolInUse) -> "Commanded":
        """The same with the tool, and the loads, of some poses."""

    @abstractmethod
    def predict(self, poses: Table, tool_rows: int = 0) -> Prediction:
        """What instruments will read in other poses, with bands.

        Args:
            poses: The file, or a data frame that holds what it would.
            tool_rows: Rows at its beginning that place the markers on the tool.

        Raises:
            UserError: The file cannot be read, or a pose does not come to rest.
        """


class Commanded(ABC):
    """A calibrated robot that is commanded with the tool of some poses."""

    @property
    @abstractmethod
    def robot(self) -> Robot:
        """The chain, whose joints have limits."""

    @abstractmethod
    def commands(self, q: Array, wrench: Array) -> Array:
        """Joint variables (t, n) to command; NaN where there are none near the desired ones.

        Args:
            q: Desired joint variables (t, n) [rad or m].
            wrench: Forces and torques (t, 6) [N, N m].

        Raises:
            NoEquilibriumError: A pose does not come to rest.
        """

    @abstractmethod
    def compensation(self, rows: Indices, q: Array, wrench: Array, command: Array) -> Compensation:
        """The commands (t, n) with their errors.

        Raises:
            NoEquilibriumError: A pose does not come to rest.
        """

    @abstractmethod
    def why_no_rest(self, q: Array) -> str:
        """Why a pose (n,) does not come to rest, in words."""


def compensate(
    calibrated: Calibrated, task: Plan, path: Path | str, own: bool = False
) -> Compensation:
    """Compute commands for task poses with the tool of the test poses, and the errors they leave.

    Rows that have no answer are left out, and named in the result.

    Args:
        calibrated: The robot.
        task: Desired poses and wrenches.
        path: Where the task comes from, for messages.
        own: Whether these are the study's own test poses, each with its own tool and payload.

    Raises:
        UserError: The study has no test pose where it needs one, or some with different tools that
            are not its own poses; or every desired or commanded pose is beyond a joint's limits,
            out of reach, or buckles; names the first row.
    """
    parts: list[Compensation] = []
    refused: list[RefusedRow] = []
    for tool in calibrated.tools(len(task.q), own):
        part, left_out = _with_tool(calibrated.with_tool(tool), tool.rows, task)
        refused += left_out
        parts += [] if part is None else [part]
    findings = task_findings(calibrated.study, calibrated.compliances, task)
    if findings and not parts:
        refused = [replace(row, reason=f"{row.reason}; {findings[0]}") for row in refused]
    require_one(len(parts), refused, path)
    joined = Compensation.joined(parts, sorted(refused, key=lambda row: row.row))
    if joined.remaining is not None:
        errors = {joint.name: (joint.std, error) for joint, error in joined.by_joints}
        known = unstated_findings(calibrated.study, errors, joined.remaining)
        findings = (*findings, *known)
    return replace(joined, findings=findings)


def _with_tool(
    robot: Commanded, rows: Indices, task: Plan
) -> tuple[Compensation | None, list[RefusedRow]]:
    """The commands for the poses of one tool that have one; None if no pose has."""
    refused: list[RefusedRow] = []
    while len(rows):
        try:
            return _commands(robot, rows, task), refused
        except RefusedRowsError as error:
            bad = [int(rows[one.row]) for one in error.rows]
            refused += [replace(one, row=row) for one, row in zip(error.rows, bad, strict=True)]
            rows = np.setdiff1d(rows, bad)
    return None, refused


def _commands(robot: Commanded, rows: Indices, task: Plan) -> Compensation:
    """The commands for some poses.

    Raises:
        RefusedRowsError: Some of them have none; rows are counted among these.
    """
    q, wrench = task.q[rows], task.wrench[rows]
    _require_within_limits(robot.robot, q, "desired", DISPLAYED)
    try:
        command = robot.commands(q, wrench)
        lost = np.flatnonzero(~np.isfinite(command).all(axis=1))
        if len(lost):
            raise RefusedRowsError([RefusedRow(int(row), NO_COMMAND) for row in lost])
        _require_within_limits(robot.robot, command, "commanded", AT_LIMIT)
        return robot.compensation(rows, q, wrench, command)
    except NoEquilibriumError as error:
        reasons = [RefusedRow(pose, robot.why_no_rest(q[pose])) for pose in error.poses]
        raise RefusedRowsError(reasons) from error


def band_of(every: NormalMixture, noise: NormalMixture | None) -> Array:
    """The 95 % band (t, 2) of errors by all that is uncertain, beginning where the noise's does.

    What load, tool, joints and model may be off by is assumed. On the day they may as well be as
    the study states them: then the noise alone is left.
    """
    band = every.quantiles(BAND)
    if noise is not None:
        band[:, 0] = np.minimum(noise.quantiles(BAND[:1])[:, 0], band[:, 0])
    return band


def _require_within_limits(robot: Robot, q: Array, which: str, beyond: float) -> None:
    """Check that every pose (t, n) is within the joints' limits, but for so much.

    Raises:
        RefusedRowsError: Some are not; names the first joint of each.
    """
    outside = robot.bounds.excess(q) > beyond
    columns = pose_columns(robot)
    refused = []
    for row in np.flatnonzero(outside.any(axis=1)):
        first = Beyond.of(robot, q[row], int(np.argmax(outside[row])))
        low, high = first.limits
        of = "" if first.name == robot.joint_names[first.joint] else f" of {first.name}"
        reason = (
            f"the {which} value {first.value:.6g}{of} is outside the joint's limits "
            f"{low:.6g} .. {high:.6g}"
        )
        refused.append(RefusedRow(int(row), reason, columns[first.joint]))
    if refused:
        raise RefusedRowsError(refused)
