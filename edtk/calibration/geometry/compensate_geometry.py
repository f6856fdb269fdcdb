"""Commands that bring the markers where the robot of the drawing would have them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from edtk.calibration.compensate import BAND, Compensation
from edtk.calibration.geometry.geometric_calibration import read_geometry
from edtk.calibration.geometry.pieces_left import PiecesLeft
from edtk.calibration.propagation import root_of
from edtk.calibration.tasks_in_use import RefusedRow, ToolInUse, require_one, tools_of_task
from edtk.design.plan import Plan
from edtk.fit.distributions import NormalMixture, offset_error_quantiles
from edtk.fit.geometry.fitted_geometry import FittedGeometry, Loads
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import why_no_rest
from edtk.measure.measured_model import Seen
from edtk.measure.parameters import TURNS, Parameter
from edtk.measure.task import Task
from edtk.robots.robot import Robot
from edtk.robots.rotations import rotation_vectors
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry
from edtk.system.errors import UserError
from edtk.system.typing import Array, Indices, Mask

STEPS = 30  # of Newton's method; four are the rule
SETTLED = 1e-9  # [m, rad] a step that moves no marker by more ends the search
REACHED = 1e-6  # [m, rad] a last step that moves one by more leads nowhere: a stretched arm's do
SINGULAR = 1e-4  # of the largest singular value: smaller ones of a Jacobian are not used
FAR = 0.2  # [rad or m] a correction is never so large
MM = 1e3
POSITION = 3  # rows of a marker, ahead of those of its orientation
DIGITS = 1e-4  # [rad or m] that a controller's display leaves out


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

    def of_poses(self, rows: Indices) -> "MarkerGoal":
        """The same of some of the poses."""
        return replace(
            self, points=self.points[rows], turns=None if self.turns is None else self.turns[rows]
        )

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
            step = np.clip(self._step(seen, seen.by_joints), -FAR, FAR)
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
class _InPoses:
    """What a fitted robot does in the poses of one tool, or of the markers.

    Attributes:
        fitted: The identified robot, with that tool or with the markers.
        loads: What loads its joints.
        goal: Where the drawing carries tool or markers in the poses.
        rows: Rows (t,) of the task that these are.
        model: The drawing under a wrench alone; None where nothing bends it.
        pieces: What its springs lack; None where nothing tells it.
    """

    fitted: FittedGeometry
    loads: Loads | None
    goal: MarkerGoal
    rows: Indices
    model: ElastostaticModel | None = None
    pieces: PiecesLeft | None = None

    @classmethod
    def of(
        cls,
        setting: StudyGeometry,
        fitted: FittedGeometry,
        tool: ToolInUse,
        every: Array,
        pieces: PiecesLeft | None,
    ) -> "_InPoses":
        """With the tool of some poses, of all (t, n)."""
        task = tool.task
        robot = fitted if task.tool is None else fitted.at_tool(task.tool)
        goal = MarkerGoal.of(robot, every[tool.rows])
        loads = setting.loads_of(task)
        model = None if loads is None else loads.by_wrench
        return cls(robot, loads, goal, tool.rows, model, pieces)

    def commands(self, every: Array, wrench: Array) -> Array:
        """Commands (t, n) in these poses, of all (m, n) with their wrenches (m, 6)."""
        rows = self.rows
        return self.goal.commands(self.fitted, every[rows], wrench[rows], self.loads)

    def snapping(self, every: Array, command: Array, wrench: Array) -> list[RefusedRow]:
        """Rows in which the arm does not come to rest under the load, with or without the command.

        Args:
            every: Desired joints (m, n) of all rows.
            command: Commands (m, n).
            wrench: Forces and torques (m, 6).
        """
        k = self.fitted.compliances
        refused = []
        for row in self.rows:
            q = np.stack([every[row], command[row]])
            q = q[np.isfinite(q).all(axis=1)]
            if self.fitted.snaps(q, np.tile(wrench[row], (len(q), 1)), self.loads).any():
                reason = why_no_rest(self.fitted.model.robot, every[row], k)
                refused.append(RefusedRow(int(row), reason))
        return refused

    def errors(
        self, every: Array, command: Array, wrench: Array, rows: Indices
    ) -> tuple[Indices, Array, Array | None]:
        """Errors before and after in those of some rows that are among these poses.

        Returns:
            The rows (r,); errors (3, r) of positions [m], without compensation, left by the
            commands, and to expect; and those of orientations [rad], None without any.
        """
        own = np.isin(self.rows, rows)
        at = self.rows[own]
        goal = self.goal.of_poses(np.flatnonzero(own))
        plain, plain_turn = _errors(self.fitted, goal, every[at], wrench[at], self.loads)
        left, left_turn = _errors(self.fitted, goal, command[at], wrench[at], self.loads)
        predicted = self.fitted.predict(command[at], wrench[at], self.loads)
        noise = self.fitted.noise
        known = 0.0 if noise.unknown else 1.0  # else readings and model are not told apart
        reading = known * noise.squared_reading(predicted.points).mean(axis=1) / MM**2
        remaining = _remaining(predicted.std, reading, left)
        with_pieces = self._with_pieces(command[at], wrench[at], goal)
        if with_pieces is not None:
            remaining = with_pieces.size
        lengths = np.stack([plain, left, remaining])
        if plain_turn is None or left_turn is None or predicted.turn_std is None:
            return at, lengths, None
        std = predicted.turn_std if goal.turned is None else predicted.turn_std[:, goal.turned]
        turned = _remaining(std, known * 3 * ((noise.turn or 0.0) / MM) ** 2, left_turn)
        return at, lengths, np.stack([plain_turn, left_turn, turned])

    def bands(self, command: Array, wrench: Array, rows: Indices) -> Array:
        """The 95 % bands (r, 2) of the errors of positions that commands leave in some rows [m].

        The error of a coordinate is what the command leaves by the identified model, and normal
        beside that; of several markers the root mean square of their distances counts. Where pieces
        that the springs lack are possible, a band begins at what the noise alone leaves: the robot
        may as well lack none.
        """
        own = np.isin(self.rows, rows)
        at = self.rows[own]
        goal = self.goal.of_poses(np.flatnonzero(own))
        with_pieces = self._with_pieces(command[at], wrench[at], goal)
        if with_pieces is not None:
            band = with_pieces.quantiles(BAND)
            band[:, 0] = np.minimum(band[:, 0], self._least(command[at], wrench[at], goal))
            return band
        torque = self.fitted.torque(command[at], wrench[at], self.loads)
        seen = self.fitted.model.see(self.fitted.theta, command[at], torque, derivatives=False)
        off = seen.points - goal.points
        covariance, dof = self.fitted.lasting(command[at], wrench[at], self.loads)
        count = np.sqrt(off.shape[1])
        rest = np.where(np.abs(off) < SETTLED, 0.0, off).reshape(len(at), -1)
        roots = np.stack([root_of(one) for one in covariance])
        eye = np.eye(rest.shape[1])
        # Of the least degrees of freedom the bands are the widest.
        return offset_error_quantiles(roots, eye, rest, BAND, float(dof.min())) / count

    def _least(self, q: Array, wrench: Array, goal: MarkerGoal) -> Array:
        """The 2.5 % quantiles (t,) of errors by the noise of the calibration alone [m]."""
        fitted = self.fitted
        seen, _, J, _ = fitted.moves(q, wrench, self.loads)
        lengths = np.arange(J.shape[1]) % fitted.model.row_count < POSITION
        root = np.sqrt(len(fitted.model.markers))
        still = (seen.points - goal.points).reshape(len(q), -1) / root
        columns = J[:, lengths] / (MM * root)
        found = offset_error_quantiles(columns, fitted.covariance, still, BAND[:1])
        return np.asarray(found[:, 0])

    def _with_pieces(self, q: Array, wrench: Array, goal: MarkerGoal) -> NormalMixture | None:
        """Errors in commanded poses (t, n) where the sheet tells pieces that the springs lack.

        Joints and model err in each pose besides. None where nothing tells pieces.
        """
        fitted = self.fitted
        if self.pieces is None or self.model is None:
            return None
        seen, motion, J, _ = fitted.moves(q, wrench, self.loads)
        rows = fitted.model.row_count
        lengths = np.arange(J.shape[1]) % rows < POSITION
        J, motion = J[:, lengths], motion[:, lengths]
        root = np.sqrt(len(fitted.model.markers))
        V = replace(fitted.noise, turn=None, model_turn=0.0).of_model(motion)
        V = V + (motion * np.square(np.asarray(fitted.noise.joints))) @ np.swapaxes(motion, 1, 2)
        still = (seen.points - goal.points).reshape(len(q), -1) / root
        found = self.pieces.mixture(fitted, self.model, q, wrench, J)
        return found.plus(V / (MM * root) ** 2, still)


def compensate_geometry(
    study: Study,
    result: Mapping[str, Any],
    where: Path | str,
    task: Plan,
    poses: Path | str,
    own: bool = False,
) -> Compensation:
    """Find commands that carry tool or markers where the drawing's robot carries them.

    The robot of the drawing stands where it fitted the positions best, with the markers where they
    fitted best, and moves without a load. A command q of the identified robot brings the tool of
    the test poses there, or the markers where they name none, under the load of the pose, see
    `MarkerGoal`. A tool has position and orientation. Three markers fix both, one the position
    alone, unless its orientation was measured too. Rows that have no command are left out, and
    named in the result.

    Args:
        study: A study with [parameters].
        result: The result of its calibration, with the table `geometry`.
        where: The result, for messages.
        task: Poses and wrenches.
        poses: Their file, for messages.
        own: Whether these are the study's own test poses, each with its own tool and payload.

    Raises:
        UserError: The result is of another study, no pose can be reached within the joints'
            limits, which names the first row; or test poses have several tools that are not own.
    """
    setting, fitted, counting = read_geometry(study, result["geometry"], where)
    if fitted.model.row_count == 6 and fitted.placed_turns is None:
        message = "the result is older than commands for full poses; identify the sheet anew"
        raise UserError(message, where=where, key="geometry.placed_turns_rad")
    every = counting.turned(task.q)
    tools = _of_markers(study, len(every))
    if study.tasks:
        tools = tools_of_task(study, len(every), own)
    on_tool = np.flatnonzero(fitted.model.on_tool)
    if not len(on_tool) and any(tool.task.tool is None for tool in tools):
        message = "no marker is on the tool, and no task says where another tool is; expected one"
        raise UserError(message, where=where)
    pieces = _pieces_of(result, fitted, where)
    fitted = fitted.of_markers(on_tool)
    parts = [_InPoses.of(setting, fitted, tool, every, pieces) for tool in tools]
    command = np.empty_like(every)
    for part in parts:
        command[part.rows] = part.commands(every, task.wrench)
    snapping = [row for part in parts for row in part.snapping(every, command, task.wrench)]
    others = _not_reached(study.robot, counting.back(command), task.q)
    refused = list({row.row: row for row in (*others, *snapping)}.values())
    refused.sort(key=lambda row: row.row)
    rows = np.setdiff1d(np.arange(len(every)), [row.row for row in refused])
    require_one(len(rows), refused, poses)
    each = [part.errors(every, command, task.wrench, rows) for part in parts]
    order = np.argsort(np.concatenate([at for at, _, _ in each]), kind="stable")
    lengths = np.concatenate([errors for _, errors, _ in each], axis=1)[:, order]
    turns = _in_order([errors for _, _, errors in each], order)
    verdict = result.get("verdict")
    return Compensation(
        robot=study.robot,
        desired=task.q[rows],
        wrench=task.wrench[rows],
        command=counting.back(command[rows]),
        uncompensated=lengths[0],
        remaining=lengths[2],
        band=np.concatenate([part.bands(command, task.wrench, rows) for part in parts])[order],
        verdict=str(verdict) if isinstance(verdict, str) else None,
        rotation=turns[2],
        rows=rows,
        refused=tuple(refused),
        left=lengths[1],
        rotation_before=turns[0],
        rotation_left=turns[1],
    )


def _in_order(each: Sequence[Array | None], order: Indices) -> Sequence[Array | None]:
    """Errors of orientation (3, m) in the order of the poses; None where a part has none."""
    known = [errors for errors in each if errors is not None]
    if len(known) < len(each):
        return (None, None, None)
    return [*np.concatenate(known, axis=1)[:, order]]


def _pieces_of(
    result: Mapping[str, Any], fitted: FittedGeometry, where: Path | str
) -> PiecesLeft | None:
    """What a result says of pieces that its springs lack; None where it does not.

    Raises:
        UserError: It is not valid.
    """
    given = result.get("possible_springs")
    if given is None:
        return None
    names = tuple(one.name for one in fitted.model.parameters)
    try:
        return PiecesLeft.from_dict(given, names, fitted.model.robot.n)
    except (ValueError, AttributeError) as error:
        raise UserError(str(error), where=where, key="possible_springs") from error


def _of_markers(study: Study, poses: int) -> tuple[ToolInUse, ...]:
    """The markers, in poses of a study without tasks."""
    markers = Task(q=np.zeros(study.robot.n), tool=None, wrench=np.zeros(6), robot=study.robot)
    return (ToolInUse(np.arange(poses), markers),)


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


def _remaining(std: Array, reading: Array | float, left: Array) -> Array:
    """Root mean square error (t,) of a marker, of all errors but a reading's.

    Args:
        std: Standard deviations (t, k, 3) of measured coordinates.
        reading: Mean square (t,) of what readings are off.
        left: What the commands leave (t,), by the identified model.
    """
    squares = (std**2).sum(axis=-1).mean(axis=-1)
    return np.asarray(np.sqrt(np.maximum(squares - reading, 0.0) + left**2))


def _not_reached(robot: Robot, command: Array, desired: Array) -> list[RefusedRow]:
    """Poses at which the search did not end nearby, within the joints' limits.

    Args:
        robot: Has the limits.
        command: Joint variables (t, n) where the search ended [rad or m].
        desired: Joint variables (t, n) where it began.
    """
    # A pose that is on a limit is so to the digits that a controller shows.
    asked = robot.bounds.excess(desired) > DIGITS
    near: Mask = np.abs(command - desired).max(axis=1) <= FAR
    answered = robot.bounds.excess(command) > 0
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
    """The first joint of some bounds."""
    return robot.bounds.names[int(np.argmax(which))]
