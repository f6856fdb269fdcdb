"""The last step of a calibration: commands that keep the robot accurate under its task's load."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.model_left import ModelLeft
from edtk.calibration.prediction import POSSIBLE, model_of_result
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
from edtk.fit.distributions import error_quantiles, offset_error_quantiles
from edtk.measure.cells import csv_text
from edtk.measure.compliances import Compliances
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import (
    NoEquilibriumError,
    Rest,
    compensated_joints,
    unloaded,
    why_no_rest,
)
from edtk.measure.expected_error import (
    AssumedJoint,
    compensation_accuracy,
    remaining_error,
    with_rigid,
)
from edtk.measure.pose_table import (
    BAND_COLUMNS,
    PART_COLUMNS,
    REMAINING_COLUMN,
    REMAINING_ROTATION_COLUMN,
    ROW_COLUMN,
    UNCOMPENSATED_COLUMN,
    UNCOMPENSATED_ROTATION_COLUMN,
    WRENCH_COLUMNS,
    pose_columns,
    pose_factors,
)
from edtk.measure.task import RigidJoint, all_compliances, rigid_joints, rigid_joints_in_words
from edtk.robots.robot import Beyond, Robot
from edtk.study.study import Study
from edtk.study.study_model import assumed_joints
from edtk.system.errors import UserError
from edtk.system.files import write_text
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd

BAND = (0.025, 0.975)
ROUNDING = 1e-9  # [rad or m]: a joint at its very limit counts as within
SETTLED = 1e-8  # [rad or m]: an arm that settles farther from the desired joints has buckled


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
        by_joints: The joints that are not identified, and what each makes of it (t,) [m].
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
        if len(parts) == 1:
            return replace(first, refused=tuple(refused))
        order = np.argsort(np.concatenate([part.rows for part in parts]))

        def all_of(name: str) -> Any:
            """One column of all parts; None where it is not known."""
            each = [getattr(part, name) for part in parts]
            return None if each[0] is None else np.concatenate(each)[order]

        most: dict[str, RigidJoint] = {}
        for joint in sorted(
            (joint for part in parts for joint in part.rigid_joints),
            key=lambda joint: joint.displacement,
        ):
            most[joint.name] = joint
        names = first.robot.joint_names
        return cls(
            robot=first.robot,
            desired=all_of("desired"),
            wrench=all_of("wrench"),
            command=all_of("command"),
            uncompensated=all_of("uncompensated"),
            remaining=all_of("remaining"),
            band=all_of("band"),
            linear=all_of("linear"),
            rho0_bias=first.rho0_bias,
            rigid_joints=tuple(most[name] for name in names if name in most),
            verdict=first.verdict,
            rotation=all_of("rotation"),
            rows=all_of("rows"),
            refused=tuple(refused),
            by_noise=all_of("by_noise"),
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
    try:
        taken = _Taken.of(study, found)
    except ValueError as error:
        raise UserError(str(error), where=found.where, key=POSSIBLE) from error
    turned = any(one.lever for one in study.tasks)
    parts: list[Compensation] = []
    refused: list[RefusedRow] = []
    tools = tools_of_task(study, len(task.q), own)
    findings = task_findings(study, found, task)
    for tool in tools:
        part, left_out = _with_tool(tool, taken, task, turned)
        refused += left_out
        parts += [] if part is None else [part]
    if findings and not parts:
        refused = [replace(row, reason=f"{row.reason}; {findings[0]}") for row in refused]
    require_one(len(parts), refused, path)
    joined = Compensation.joined(parts, sorted(refused, key=lambda row: row.row))
    return replace(joined, findings=findings)


@dataclass(frozen=True, eq=False)
class _Taken:
    """The compliances by which commands are made.

    Attributes:
        identified: Those that were identified, with their covariance by noise and model.
        every: The same with those of all other joints, and with all that is uncertain.
        model: What errors of the model leave; None where nothing is known of them.
    """

    identified: Compliances
    every: Compliances
    model: ModelLeft | None = None

    @classmethod
    def of(cls, study: Study, found: Compliances) -> "_Taken":
        """With what the study takes of joints that were not identified."""
        given = dict(zip(found.joints, found.k, strict=True))
        k = np.array([given.get(name, 0.0) for name in study.specification.joints.unknown])
        left = model_of_result(study, found.possible)
        return cls(found, found.including(assumed_joints(study, k)), left)


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
    model = tool.model(joints, all_compliances(ElastostaticModel(robot, joints), found.k))
    q = compensated_joints(model, task.q, task.wrench, found.k)
    _require_within_limits(robot, task.q, "desired")
    _require_within_limits(robot, q, "commanded")
    k = all_compliances(model, found.k)
    with _buckling_rows(robot, q, k):
        moved = _uncompensated(model, task, k)
        _require_settled(model, task, q, k)
        offset = _offset(model, task, found)
    A = model.regressor(task.q, task.wrench)
    known = tuple(robot.joint_names[j] for j in joints if k[j])
    assumed = [one.joint for one in found.assumed]
    after = _errors_after(model, task, taken, offset)
    return Compensation(
        robot=robot,
        desired=task.q,
        wrench=task.wrench,
        command=q,
        uncompensated=with_rigid(moved, A[..., len(joints) - len(found.assumed) :], assumed),
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
def _buckling_rows(robot: Robot, q: Array, k: Array) -> Iterator[None]:
    """Name the poses that do not come to rest.

    Raises:
        RefusedRowsError: Some do not.
    """
    try:
        yield
    except NoEquilibriumError as error:
        reasons = {pose: why_no_rest(robot, q[pose], k) for pose in error.poses}
        raise RefusedRowsError([RefusedRow(*one) for one in reasons.items()]) from error


def _uncompensated(model: ElastostaticModel, task: Plan, k: Array) -> Array:
    """Distance (t,) of the loaded tool point from the desired one without compensation [m].

    Raises:
        NoEquilibriumError: A pose buckles.
    """
    rest = Rest.of(model, task.q, task.wrench, k)
    moved = model.robot.forward(rest.end)[:, :3, 3] - model.robot.forward(rest.start)[:, :3, 3]
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
    if taken.model is not None:
        return _with_model(model, task, taken, offset, tuple(each))
    dof = _degrees_of_freedom(found.covariance_dof, total, noise)
    band = _band(A, found.covariance, offset, dof)
    least = _band(A[..., :p], identified.covariance, offset, found.covariance_dof)
    off = np.zeros_like(total) if offset is None else np.linalg.norm(offset, axis=-1)
    return _After(np.hypot(total, off), _from_least(least, band), noise, tuple(each))


def _band(A: Array, covariance: Array, offset: Array | None, dof: float) -> Array:
    """The 95 % band (t, 2) of errors by wrong compliances, and by an offset (t, 3) [m]."""
    if offset is None:
        return error_quantiles(A, covariance, BAND, dof)
    return offset_error_quantiles(A, covariance, offset, BAND, dof)


def _from_least(least: Array, band: Array) -> Array:
    """A band (t, 2) that begins where that of the noise alone does.

    What load, tool, joints and model may be off by is assumed. On the day they may as well be as
    the study states them: then the noise alone is left.
    """
    return np.column_stack([np.minimum(least[:, 0], band[:, 0]), band[:, 1]])


def _with_model(
    model: ElastostaticModel,
    task: Plan,
    taken: _Taken,
    offset: Array | None,
    each: tuple[tuple[AssumedJoint, Array], ...],
) -> _After:
    """The errors that wrong compliances leave, and what the model leaves out."""
    assert taken.model is not None
    assert taken.every.covariance is not None
    assert taken.identified.covariance is not None
    left = taken.model
    A = model.regressor(task.q, task.wrench)
    transposed = np.swapaxes(A, -1, -2)
    p, more = len(left.joints), A.shape[-1] - len(left.joints)
    exact = taken.every.covariance + np.pad(left.noise - taken.identified.covariance, (0, more))
    beside = left.beside if len(left.beside) == p + more else np.pad(left.beside[:p, :p], (0, more))
    found = left.mixture(model, task.q, task.wrench).plus(A @ beside @ transposed, offset)
    noise = compensation_accuracy(A[..., :p], left.noise)
    # At least what the budget counts without errors of the model, see `Propagation.budget`.
    without = np.einsum("trr->t", A @ exact @ transposed)
    if offset is not None:
        without = without + np.square(offset).sum(axis=-1)
    size = np.sqrt(np.maximum(np.square(found.size), without))
    least = _band(A[..., :p], left.noise, offset, left.dof)
    return _After(size, _from_least(least, found.quantiles(BAND)), noise, each)


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
    loaded = Rest.of(model, q, task.wrench, k).end
    lost = np.flatnonzero(np.abs(loaded - unloaded(model, task.q, k)).max(axis=-1) > SETTLED)
    if len(lost):
        raise NoEquilibriumError(lost.tolist())


def _require_within_limits(robot: Robot, q: Array, which: str) -> None:
    """Check that every pose (t, n) is within the joints' limits.

    Raises:
        RefusedRowsError: Some are not; names the first joint of each.
    """
    outside = robot.bounds.excess(q) > ROUNDING
    columns = pose_columns(robot)
    refused = []
    for row in np.flatnonzero(outside.any(axis=1)):
        beyond = Beyond.of(robot, q[row], int(np.argmax(outside[row])))
        low, high = beyond.limits
        of = "" if beyond.name == robot.joint_names[beyond.joint] else f" of {beyond.name}"
        reason = (
            f"the {which} value {beyond.value:.6g}{of} is outside the joint's limits "
            f"{low:.6g} .. {high:.6g}"
        )
        refused.append(RefusedRow(int(row), reason, columns[beyond.joint]))
    if refused:
        raise RefusedRowsError(refused)
