"""Geometry that a calibration has found: the commands, and the positions it predicts."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from edtk.calibration.compensate import Calibrated, Commanded, Compensation, band_of
from edtk.calibration.model_left import PiecesLeft
from edtk.calibration.prediction import (
    Columns,
    Prediction,
    beyond_limits,
    in_columns,
    tool_from_rows,
)
from edtk.calibration.result_file import POSSIBLE, possible_springs, read_geometry
from edtk.calibration.tasks_in_use import ToolInUse, reading_findings
from edtk.findings.counting import Counting
from edtk.findings.prior import unstated
from edtk.findings.turn_reading import EXPECTED, turn_reading
from edtk.findings.units import like_radians
from edtk.fit.distributions import NormalMixture
from edtk.fit.fitted_geometry import RIGID, FittedGeometry, Predicted
from edtk.fit.marker_positions import MarkerPositions, read_positions
from edtk.fit.sheet import VECTOR
from edtk.measure.equilibrium import Loads, NoEquilibriumError, why_no_rest
from edtk.measure.expected_error import AssumedJoint, compensation_accuracy
from edtk.measure.measured_model import Seen
from edtk.measure.parameters import TURNS, Parameter
from edtk.measure.pose_table import (
    CHANGE_COLUMN,
    DEFLECTION_COLUMNS,
    DISTANCE_COLUMN,
    LOADED_COLUMNS,
    ROTATION_COLUMNS,
    Table,
    path_of,
)
from edtk.measure.task import Task
from edtk.robots.frames import MM
from edtk.robots.robot import Robot
from edtk.robots.rotations import rotation_vectors
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry, StudyLoads
from edtk.study.study_model import KNOWN, marker_names
from edtk.system.errors import ArgumentError, UserError
from edtk.system.typing import Array, Indices, Mask

STEPS = 30  # of Newton's method; four are the rule
SETTLED = 1e-9  # [m, rad] a step that moves no marker by more ends the search
REACHED = 1e-6  # [m, rad] a last step that moves one by more leads nowhere: a stretched arm's do
SINGULAR = 1e-4  # of the largest singular value: smaller ones of a Jacobian are not used
LARGEST_CORRECTION = 0.2  # [rad or m] a correction is never so large


@dataclass(frozen=True, eq=False)
class MarkerGoal:
    """Where the robot of the drawing carries the markers in some poses.

    It stands where it fitted the measurements best, with the markers where they fitted best, and no
    load bends it.

    Attributes:
        points: Positions (t, k, 3) [m].
        turns: Orientations (t, k, 3, 3); None where positions alone are asked for.
        turned: Of which markers (k,) these are measured; None for all.
    """

    points: Array
    turns: Array | None
    turned: Mask | None = None

    @classmethod
    def of(cls, fitted: FittedGeometry, q: Array) -> "MarkerGoal":
        """In poses q (t, n) of the drawing."""
        drawing = replace(fitted.model, offsets=fitted.placed, parameters=())
        if fitted.placed_turns is None:
            return cls(drawing.see(np.zeros(0), q, derivatives=False).points, None)
        own = tuple(Parameter("tool", name, c) for name in drawing.markers for c in TURNS)
        turned = np.array([kind == "pose" for kind in drawing.kinds])
        seen = drawing.with_parameters(own).see(
            fitted.placed_turns.reshape(-1), q, derivatives=False
        )
        return cls(seen.points, seen.turns, turned)

    def commands(
        self, fitted: FittedGeometry, start: Array, wrench: Array, loads: Loads | None
    ) -> Array:
        """Commands (t, n) near a start (t, n) that bring the markers here, loads included.

        ``sum_i |x_i(q) - y_i|^2`` of the positions is least, by Newton's method with the smallest
        steps (Gauss-Newton with a pseudo-inverse). Motions that leave the positions alone bring the
        orientations as near as they can: of one marker on six joints all the way, and a robot of
        fewer joints pays no position for them. NaN where the steps do not settle.

        Args:
            fitted: The identified robot.
            start: Joint variables (t, n) [rad or m].
            wrench: Forces and torques (t, 6) in these poses [N, N m].
            loads: What loads the joints.
        """
        q = start.copy()
        moved = np.full(len(q), np.inf)
        for _ in range(STEPS):
            seen = fitted.model.see(fitted.theta, q, fitted.torque(q, wrench, loads))
            assert seen.by_joints is not None
            step = np.clip(
                self._step(seen, seen.by_joints), -LARGEST_CORRECTION, LARGEST_CORRECTION
            )
            q = q + step
            moved = np.abs(np.einsum("tkrn,tn->tkr", seen.by_joints, step)).max(axis=(1, 2))
            if moved.max(initial=0.0) < SETTLED:
                break
        return np.where((moved < REACHED)[:, None], q, np.nan)

    def distance(self, seen: Seen) -> Array:
        """Root mean square distance (t,) of the markers from their goals [m]."""
        return np.asarray(np.sqrt(((seen.points - self.points) ** 2).sum(axis=-1).mean(axis=-1)))

    def angle(self, seen: Seen) -> Array | None:
        """Root mean square angle (t,) of the markers from their goals [rad]; None without any."""
        if self.turns is None:
            return None
        squares = (self._to_turn(seen) ** 2).sum(axis=-1)
        counted = slice(None) if self.turned is None else self.turned
        return np.asarray(np.sqrt(squares[:, counted].mean(axis=-1)))

    def _to_turn(self, seen: Seen) -> Array:
        """Turns (t, k, 3) that lead to the goals, in the axes of the instrument [rad]."""
        assert self.turns is not None
        found = rotation_vectors(self.turns @ np.swapaxes(seen.turns, -1, -2))
        return found if self.turned is None else np.where(self.turned[:, None], found, 0.0)

    def _step(self, seen: Seen, by_joints: Array) -> Array:
        """One step (t, n) of the joints."""
        t, n = by_joints.shape[0], by_joints.shape[-1]
        J = by_joints[:, :, :3].reshape(t, -1, n)
        inverse = np.linalg.pinv(J, rcond=SINGULAR)
        apart = (self.points - seen.points).reshape(t, -1, 1)
        step = inverse @ apart
        if self.turns is not None:
            W = by_joints[:, :, 3:].reshape(t, -1, n)
            free = np.eye(n) - inverse @ J
            to_turn = self._to_turn(seen).reshape(t, -1, 1) - W @ step
            step = step + _pseudo_inverse(W @ free, _largest(W)) @ to_turn
        return np.asarray(step[..., 0])


def _largest(A: Array) -> Array:
    """Largest singular values (t,) of matrices (t, r, n)."""
    return np.asarray(np.linalg.norm(A, ord=2, axis=(1, 2)))


def _pseudo_inverse(A: Array, size: Array) -> Array:
    """Pseudo-inverses (t, n, r) of matrices (t, r, n), for the scale of sizes (t,).

    Where the positions leave no motion free, A is nothing but rounding, whose own scale would make
    steps of it.
    """
    U, s, Vt = np.linalg.svd(A, full_matrices=False)
    used = s > SINGULAR * size[:, None]
    inverse = np.divide(1.0, s, out=np.zeros_like(s), where=used)
    return np.asarray((np.swapaxes(Vt, 1, 2) * inverse[:, None]) @ np.swapaxes(U, 1, 2))


@dataclass(frozen=True, eq=False)
class CalibratedGeometry(Calibrated):
    """A robot of which geometry was identified, and perhaps springs.

    The robot of the drawing stands where it fitted the positions best, with the markers where they
    fitted best, and moves without a load. A command of the identified robot brings the tool of the
    test poses there, or the markers where they name none, under the load of the pose, see
    `MarkerGoal`. A tool has position and orientation. Three markers fix both, one the position
    alone, unless its orientation was measured too.

    Attributes:
        study: The study of the calibration.
        setting: Its markers and loads.
        fitted: What was identified.
        counting: How the sheet counts the joints.
        result: All that the result says.
        where: The result, for messages.
    """

    study: Study
    setting: StudyGeometry
    fitted: FittedGeometry
    counting: Counting
    result: Mapping[str, Any]
    where: Path | str

    @classmethod
    def of(cls, study: Study, result: Mapping[str, Any], where: Path | str) -> "CalibratedGeometry":
        """What a result says.

        Args:
            study: A study with [parameters].
            result: The result of its calibration, with the table `geometry`.
            where: The result, for messages.

        Raises:
            UserError: The result is not valid, or of another study.
        """
        return cls(study, *read_geometry(study, result["geometry"], where), result, where)

    @property
    def verdict(self) -> str | None:
        """How the identification rated the result; None if it is not known."""
        verdict = self.result.get("verdict")
        return verdict if isinstance(verdict, str) else None

    @cached_property
    def pieces(self) -> PiecesLeft | None:
        """What a result says of pieces that its springs lack; None where it does not.

        Raises:
            UserError: It is not valid.
        """
        names = tuple(one.name for one in self.fitted.model.parameters)
        n = self.fitted.model.robot.n
        return possible_springs(
            self.result.get(POSSIBLE),
            lambda table: PiecesLeft.from_dict(table, names, n),
            self.where,
        )

    @cached_property
    def on_tool(self) -> FittedGeometry:
        """What was identified, with the markers on the tool.

        Raises:
            UserError: The result is older than commands for full poses.
        """
        model = self.fitted.model
        if model.row_count == 6 and self.fitted.placed_turns is None:
            message = "the result is older than commands for full poses; identify the sheet anew"
            raise UserError(message, where=self.where, key="geometry.placed_turns_rad")
        return self.fitted.of_markers(np.flatnonzero(model.on_tool))

    @property
    def compliances(self) -> Mapping[str, float]:
        """Those of the joints' own springs, by joint [rad/(N m)]."""
        k = self.fitted.compliances.tolist()
        return dict(zip(self.study.robot.joint_names, k, strict=True))

    def tools(self, poses: int, own: bool) -> tuple[ToolInUse, ...]:
        """The tools in which task poses are meant; the markers in a study without tasks.

        Raises:
            UserError: Markers are meant, and none is on the tool.
        """
        markers = Task(
            q=np.zeros(self.study.robot.n), tool=None, wrench=np.zeros(6), robot=self.study.robot
        )
        tools: tuple[ToolInUse, ...] = (ToolInUse(np.arange(poses), markers),)
        if self.study.tasks:
            tools = super().tools(poses, own)
        if not self.on_tool.model.markers and any(tool.task.tool is None for tool in tools):
            message = "no marker is on the tool, and no task says where another tool is"
            raise UserError(f"{message}; expected one", where=self.where)
        return tools

    def with_tool(self, tool: ToolInUse) -> "GeometryWithTool":
        """The same with the tool of some poses, or with the markers."""
        task = tool.task
        fitted = self.on_tool if task.tool is None else self.on_tool.at_tool(task.tool)
        loads = self.setting.every_load_of(task)
        fitted = fitted.under(loads, self.setting.untold(loads))
        return GeometryWithTool(self, fitted, self.setting.loads_of(task))

    def predict(self, poses: Table, tool_rows: int = 0) -> Prediction:
        """Predict the positions of markers in the poses of a file.

        Args:
            poses: The file, or a data frame that holds what it would.
            tool_rows: Rows at its beginning that place the markers on the tool.

        Raises:
            UserError: The file cannot be read.
        """
        study, setting, fitted = self.study, self.setting, self.fitted
        kinds = {name: setting.kinds[name] for name in (*setting.markers, *setting.references)}
        data = read_positions(
            poses,
            study.robot,
            study.fixed,
            kinds,
            measured=False,
            others=marker_names(study),
            reference=setting.reference,
        )
        data = setting.as_positions(data)
        beyond = beyond_limits(study.robot, data.q, data.row)
        radians = like_radians(study, data.q)
        data = self.counting.of(setting.split(data.without_lost())[0])
        _require_sound(setting, fitted, data, poses)
        tests = data.seen.copy()
        if tool_rows:
            placing = _placing(fitted, data, tool_rows, path_of(poses))
            predicted = tool_from_rows(fitted, data, placing, setting.loads)
            tests &= ~placing & ~data.is_difference[:, None]
        else:
            predicted = fitted.predict(data.q, data.wrench, setting.loads, data.is_difference)
        # Orientations are predicted though the file has none, but not of a tool that points placed.
        rows = fitted.model.present.sum(axis=1)
        rows = rows if predicted.turn_half is not None else np.minimum(rows, 3)
        found = _prediction(data, rows, predicted, tests, beyond, radians)
        return replace(found, other_units=reading_findings(study, self.compliances, data))


@dataclass(frozen=True, eq=False)
class GeometryWithTool(Commanded):
    """The robot with the tool of some task poses, or with the markers.

    Attributes:
        calibrated: What was identified.
        fitted: The same with that tool or with the markers.
        loads: What loads its joints.
    """

    calibrated: CalibratedGeometry
    fitted: FittedGeometry
    loads: StudyLoads | None

    @property
    def robot(self) -> Robot:
        """The chain of the drawing."""
        return self.calibrated.study.robot

    def commands(self, q: Array, wrench: Array) -> Array:
        """Joint variables (t, n), see `MarkerGoal.commands`; NaN where the arm does not get near.

        Raises:
            NoEquilibriumError: The arm snaps in a pose, or in its command.
        """
        counting, robot = self.calibrated.counting, self.fitted
        meant = counting.turned(q)
        snaps = robot.snaps(meant, wrench, self.loads)
        command = MarkerGoal.of(robot, meant).commands(robot, meant, wrench, self.loads)
        there = np.isfinite(command).all(axis=1)
        snaps[there] |= robot.snaps(command[there], wrench[there], self.loads)
        if snaps.any():
            raise NoEquilibriumError(np.flatnonzero(snaps).tolist())
        back = counting.back(command)
        near: Mask = np.abs(back - q).max(axis=1) <= LARGEST_CORRECTION
        return np.where(near[:, None], back, np.nan)

    def why_no_rest(self, q: Array) -> str:
        """Why a pose (n,) does not come to rest, in words."""
        meant = self.calibrated.counting.turned(q[None])[0]
        return why_no_rest(self.fitted.model.robot, meant, self.fitted.compliances)

    def compensation(self, rows: Indices, q: Array, wrench: Array, command: Array) -> Compensation:
        """The commands (t, n) with the errors of tool or markers."""
        fitted, turned = self.fitted, self.calibrated.counting.turned
        goal = MarkerGoal.of(fitted, turned(q))
        before = self._seen(turned(q), wrench)
        at = turned(command)
        after = self._seen(at, wrench)
        predicted = fitted.predict(at, wrench, self.loads)
        every, noise = self._errors(at, wrench, after.points - goal.points)
        left, angle = goal.distance(after), goal.angle(after)
        rotation = None
        if predicted.turn_std is not None and angle is not None:
            counted = slice(None) if goal.turned is None else goal.turned
            known = 0.0 if fitted.noise.unknown else 1.0  # else readings and model are one
            reading = known * 3 * ((fitted.noise.turn or 0.0) / MM) ** 2
            rotation = _remaining(predicted.turn_std[:, counted], reading, angle)
        bent = self._lengths(fitted.bent_besides(at, wrench))
        return Compensation(
            robot=self.robot,
            desired=q,
            wrench=wrench,
            command=command,
            uncompensated=np.hypot(goal.distance(before), np.linalg.norm(bent, axis=(1, 2))),
            remaining=every.size,
            band=band_of(every, noise),
            verdict=self.calibrated.verdict,
            rotation=rotation,
            rows=rows,
            left=left,
            by_noise=self._by_noise(at, wrench),
            by_joints=(*self._by_rigid(at, wrench), *self._by_known(at, wrench)),
            rotation_before=None if rotation is None else goal.angle(before),
            rotation_left=None if rotation is None else angle,
        )

    @cached_property
    def apart(self) -> FittedGeometry:
        """The same robot without what its springs lack, where that is known apart."""
        pieces = self.calibrated.pieces
        return self.fitted if pieces is None else pieces.apart(self.fitted)

    def _by_noise(self, q: Array, wrench: Array) -> Array:
        """Root mean square errors (t,) by what the fit leaves of the parameters [m]."""
        J = self._lengths(self.fitted.columns(q, wrench, self.loads))
        return compensation_accuracy(J, self.apart.covariance)

    def _by_rigid(self, q: Array, wrench: Array) -> tuple[tuple[AssumedJoint, Array], ...]:
        """Joints that count as rigid, and what each that bends as is assumed makes (t,) [m]."""
        found = self.fitted.circumstances
        if found is None:
            return ()
        E = self._lengths(self.fitted.by_circumstances(q, wrench)[RIGID])
        return tuple(zip(found.rigid, np.linalg.norm(E, axis=1).T, strict=True))

    def _by_known(self, q: Array, wrench: Array) -> tuple[tuple[AssumedJoint, Array], ...]:
        """Known compliances whose deviation nobody stated, and what goes with their errors."""
        study = self.calibrated.study
        given = unstated(study)
        errors = self.fitted.going_with(given)
        if not errors:
            return ()
        J = self._lengths(self.fitted.columns(q, wrench, self.loads))
        index = study.robot.joint_names.index
        return tuple(
            (
                AssumedJoint(name, index(name), given[name].value, std, KNOWN),
                np.linalg.norm(J @ error, axis=-1),
            )
            for name, (std, error) in errors.items()
        )

    def _lengths(self, columns: Array) -> Array:
        """The rows (t, 3k, c) of positions, whose squares add up to the mean of the markers [m]."""
        root = np.sqrt(len(self.fitted.model.markers))
        return np.asarray(columns[:, self.fitted.lengths] / (MM * root))

    def _seen(self, q: Array, wrench: Array) -> Seen:
        """Tool or markers in some poses, at rest under the load."""
        torque = self.fitted.torque(q, wrench, self.loads)
        return self.fitted.model.see(self.fitted.theta, q, torque, derivatives=False)

    def _errors(
        self, q: Array, wrench: Array, off: Array
    ) -> tuple[NormalMixture, NormalMixture | None]:
        """Errors (t, 3k) of positions in commanded poses, over the root of their number [m].

        The error of a coordinate is what the command leaves by the identified model, and normal
        beside that; of several markers the root mean square of their distances counts.

        Args:
            q: Commands (t, n).
            wrench: Forces and torques (t, 6).
            off: What they leave (t, k, 3) [m].

        Returns:
            Those by all that is uncertain. Where pieces that the springs lack are possible, also
            those by the noise of the calibration alone: the robot may as well lack none.
        """
        fitted, pieces = self.apart, self.calibrated.pieces
        root = np.sqrt(off.shape[1])
        if pieces is None or self.loads is None:
            still = np.where(np.abs(off) < SETTLED, 0.0, off).reshape(len(q), -1)
            covariance, dof = fitted.lasting(q, wrench, self.loads)
            # Of the least degrees of freedom the bands are the widest.
            least = float(dof.min())
            return NormalMixture.single(still / root, covariance / root**2, least), None
        still = off.reshape(len(q), -1) / root
        moved = fitted.moves(q, wrench, self.loads)
        kept = fitted.lengths
        J = moved[2][:, kept]
        V = fitted.beside(q, wrench, moved)[:, kept[:, None], kept]
        mixture = pieces.mixture(fitted, self.loads.by_wrench, q, wrench, J)
        columns = J / (MM * root)
        C = columns @ fitted.covariance @ np.swapaxes(columns, 1, 2)
        return mixture.plus(V / (MM * root) ** 2, still), NormalMixture.single(still, C)


def _remaining(std: Array, reading: Array | float, left: Array) -> Array:
    """Root mean square error (t,) of a marker, of all errors but a reading's.

    Args:
        std: Standard deviations (t, k, 3) of measured coordinates.
        reading: Mean square (t,) of what readings are off.
        left: What the commands leave (t,), by the identified model.
    """
    squares = (std**2).sum(axis=-1).mean(axis=-1)
    return np.asarray(np.sqrt(np.maximum(squares - reading, 0.0) + left**2))


def _require_sound(
    setting: StudyGeometry, fitted: FittedGeometry, data: MarkerPositions, poses: Table
) -> None:
    """Check that orientations are read as they are written, and that the arm rests in each pose."""
    robot = setting.study.robot
    on_tool = data.absolute.of_markers(np.arange(len(setting.on_tool)))
    reading = turn_reading(poses, robot, on_tool)
    if reading:
        raise UserError(f"the robot fits if {reading}; expected {EXPECTED}", where=path_of(poses))
    snaps = np.flatnonzero(fitted.snaps(data.q, data.wrench, setting.loads))
    if len(snaps):
        first = int(snaps[0])
        raise UserError(
            why_no_rest(robot, data.q[first], fitted.compliances),
            where=path_of(poses),
            key=f"row {int(data.row[first].max()) + 1}",
        )


def _placing(
    fitted: FittedGeometry, data: MarkerPositions, tool_rows: int, where: Path | str
) -> Mask:
    """The readings (m, k) of the first rows, which place the markers on the tool."""
    last = int(data.row.max()) + 1
    if tool_rows > last:
        message = f"{where} has {last} rows"
        raise ArgumentError(message, argument="tool_rows", given=tool_rows)
    placing = np.logical_and(data.seen, data.row < tool_rows)
    # Neither a distance nor a change under a load says where a marker is.
    placing &= ~fitted.model.is_distance & ~data.is_difference[:, None]
    if not placing.any():
        raise UserError("no marker was measured in the rows that place the tool", where=where)
    return np.asarray(placing)


def _prediction(
    data: MarkerPositions,
    rows: Indices,
    predicted: Predicted,
    tests: Mask,
    beyond: tuple[int, ...],
    radians: bool,
) -> Prediction:
    """What the file asks for, one reading after another, each of so many rows (k,)."""
    visit, marker = np.nonzero(data.row >= 0)
    chosen = (visit, marker)
    turns = predicted.turns[chosen]
    turned = np.zeros((len(visit), 3))
    turned_half = np.zeros((len(visit), 3))
    if predicted.turn_half is not None:
        given = np.full_like(turns, np.nan) if data.turns is None else data.turns[chosen]
        seen: Mask = np.all(np.isfinite(given), axis=(-1, -2))
        turned = np.where(seen[:, None, None], given, turns) @ np.swapaxes(turns, -1, -2)
        turned = np.where(seen[:, None], rotation_vectors(turned), np.nan)
        turned_half = predicted.turn_half[chosen]
    every = (
        np.hstack([predicted.points[chosen], rotation_vectors(turns)]),
        np.hstack([predicted.half[chosen], turned_half]),
        np.hstack([data.measured[chosen] - predicted.points[chosen], turned]),
    )
    columns, of_columns = in_columns(_columns(rows[marker], data.is_difference[visit]))
    values, half, apart = (of_columns(one) for one in every)
    return Prediction(
        data=data,
        what="positions",
        row=data.row[chosen],
        markers=tuple(data.markers[i] for i in marker),
        columns=columns,
        values=values,
        half=half,
        apart=apart,
        tests=tests[chosen],
        open=predicted.open[chosen],
        beyond=beyond,
        radians=radians,
    )


def _columns(rows: Indices, differs: Mask) -> tuple[Columns, ...]:
    """The columns of all readings, of their rows (t, 6).

    Args:
        rows: How many rows each reading (t,) has: one of a distance, three, or six of a pose.
        differs: Which readings (t,) are differences of two.
    """
    lengths, turns, alone = slice(0, 3), slice(3, 6), slice(0, 1)
    return (
        (LOADED_COLUMNS, (rows > 1) & ~differs, lengths),
        (DEFLECTION_COLUMNS, (rows > 1) & differs, lengths),
        ((DISTANCE_COLUMN,), (rows == 1) & ~differs, alone),
        ((CHANGE_COLUMN,), (rows == 1) & differs, alone),
        (VECTOR, (rows == 6) & ~differs, turns),
        (ROTATION_COLUMNS, (rows == 6) & differs, turns),
    )
