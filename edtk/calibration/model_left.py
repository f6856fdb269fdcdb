"""What errors of the model leave in tasks after a compensation, as far as a sheet tells them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from criteria.linalg.spectrum import is_semidefinite
from edtk.findings.finding import Data, Finding, Severity, Wording
from edtk.findings.fitted_data import FittedData
from edtk.findings.model_error import usual_share
from edtk.fit.correlated_noise import CorrelatedNoise, NoiseBlocks
from edtk.fit.distributions import NormalMixture, weighted_median
from edtk.fit.fitted_geometry import FittedGeometry, GeometricFit, loading_of
from edtk.fit.measurements import Measurements
from edtk.fit.missing import MissingColumns, SizeLikelihood, SizePosterior
from edtk.fit.pose_rows import PoseRows, known_before
from edtk.fit.same_poses import SamePoses
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.expected_error import ErrorBudget
from edtk.measure.friction import GIVES
from edtk.measure.instruments.distance import Distance
from edtk.measure.instruments.marker import Marker
from edtk.measure.instruments.pose_marker import PoseMarker
from edtk.measure.instruments.sensor import Sensor
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.missing_pieces import MissingPieces, PossibleSprings
from edtk.measure.position_noise import PositionNoise
from edtk.measure.task import Task, Tasks
from edtk.robots.frames import MM, BodyPoint, load_turns
from edtk.study.study_geometry import StudyGeometry, StudyLoads
from edtk.system.parsing import not_negative_of, numbers_of
from edtk.system.typing import Array, Mask

# Of the model's error of absolute readings, as a fit without pieces estimates it: what of it the
# drawing may be. Of the sheet alone nothing tells how springs and drawing share it.
OF_DRAWING = (0.0, 0.125, 0.25, 0.5, 1.0)
ROWS = 3  # of a position, ahead of a rotation
TOLD_CHANCE = 0.975  # of chances: an error that is larger is told
# Of a single normal error 5 % is beyond twice its size. Where chances are twice that, what the
# sheet leaves open is what the promise rests on.
OFTEN = 0.1
# Of the displacement. A compensation that takes away nine tenths is what an engineer expects;
# where less is due to the model, more measurements do not help.
LARGE = 0.1
SHARE = 0.01  # of the total error, from which a part of it is named
WRITTEN_DIGITS = 12  # of what is written, to print predictions as they are


@dataclass(frozen=True, eq=False)
class ModelLeft:
    """Springs, and what the model leaves out, that a calibration leaves possible.

    Attributes:
        joints: Indices (p,) of the identified joints, in the order of the springs.
        pieces: What may be missing.
        possible: Their sizes, and the springs.
        noise: Covariance (p, p) of the springs by the noise alone.
        beside: Covariance (p + a, p + a) of the compliances that commands take by what the sheet
            cannot tell [(rad/(N m))^2].
        constant: What is left out of a coordinate in any pose, whatever loads it [m].
        dof: Degrees of freedom of the noise; inf where it is known.
    """

    joints: tuple[int, ...]
    pieces: MissingPieces
    possible: PossibleSprings
    noise: Array
    beside: Array
    constant: float = 0.0
    dof: float = np.inf

    @classmethod
    def of(cls, fitted: FittedData, root: Array | None) -> "ModelLeft | None":
        """What a calibration leaves; None where the study says that its model is exact.

        Args:
            fitted: The measurements and their fit.
            root: Root (p + a, c) of the errors by what the sheet cannot tell.
        """
        found = fitted.model_error
        if found is None or root is None:
            return None
        dof = np.inf if fitted.fit.known else fitted.fit.covariance_dof
        joints = tuple(fitted.study.model.joints)
        known = (found.noise, root @ root.T, found.constant, dof)
        return cls(joints, found.pieces, found.possible, *known)

    def mixture(self, model: ElastostaticModel, q: Array, wrench: Array) -> NormalMixture:
        """Errors (t, rows) in poses by noise and model.

        Args:
            model: The robot with the task's tool, and the rows that count.
            q: Poses (t, n) [rad or m].
            wrench: Loads (t, 6) or (6,) [N, N m].
        """
        identified = replace(model, unknown=self.joints)
        wrench = np.broadcast_to(wrench, (len(q), np.shape(wrench)[-1]))
        columns = self.pieces.columns(model, q, wrench)
        mean, V = self.possible.errors(columns, identified.regressor(q, wrench))
        V[..., range(ROWS), range(ROWS)] += self.constant**2
        return NormalMixture(self.possible.weights, mean, V, self.dof)

    def of_readings(self, model: ElastostaticModel, data: Measurements, A: Array) -> NormalMixture:
        """Coordinates (m rows, 1) of readings, each by itself.

        Args:
            model: The robot with its calibration tool, and the measured rows.
            data: Poses, loads and instruments.
            A: Regressors (m, rows, p + a), those of the identified joints first.
        """
        given = (model, data.q, data.wrench, lambda frames: data.motion_of(model, frames))
        own = A[..., : len(self.joints)].reshape(-1, 1, len(self.joints))
        mean, V = self.possible.errors(self.pieces.columns(*given).by_row(), own)
        return NormalMixture(self.possible.weights, mean, V, self.dof)

    def in_task(self, task: Task) -> NormalMixture:
        """Errors (N, rows) in the poses of a task; rotations count with its lever."""
        q = np.atleast_2d(task.poses)
        model = replace(task.model, rows="pose") if task.lever else task.model
        found = self.mixture(model, q, task.wrench)
        if not task.lever:
            return found
        scale = np.array([1.0, 1.0, 1.0, *[task.lever] * 3])
        V = found.covariance * scale * scale[:, None]
        return replace(found, mean=found.mean * scale, covariance=V)

    def size(self, tasks: Tasks) -> float:
        """Root mean square error in tasks by noise and model [m]."""
        each = [np.square(self.in_task(task).sizes).mean(axis=1) for task in tasks]
        squares = np.einsum("t,ts->s", tasks.shares, np.array(each))
        return float(np.sqrt(weighted_median(squares, self.possible.weights)))

    def in_tasks(self, tasks: Tasks, joints: tuple[int, ...], budget: ErrorBudget) -> "LeftInTasks":
        """What is left in the study's tasks.

        Args:
            tasks: The test poses.
            joints: Indices (p + a,) of all joints whose compliances are taken.
            budget: The errors there.
        """
        parts = tuple(self._with_others(task, joints) for task in tasks)
        return LeftInTasks(tasks, parts, budget.total, budget.model, budget.uncompensated)

    def _with_others(self, task: Task, joints: tuple[int, ...]) -> NormalMixture:
        """Errors (1, rows) in a test pose by all that is uncertain."""
        here = replace(task, within=0.0)
        A = replace(here, unknown=joints).harm(np.atleast_2d(task.q))
        return self.in_task(here).plus(A @ self.beside @ np.swapaxes(A, -1, -2))

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers in SI units, and shares, in the order of the joints."""
        return {
            **possible_to_dict(self.pieces, self.possible),
            "noise": self.noise.tolist(),
            "constant": self.constant,
            "beside": self.beside.tolist(),
            "dof": self.dof if np.isfinite(self.dof) else None,
        }

    @classmethod
    def from_dict(cls, given: Mapping[str, Any], joints: tuple[int, ...], n: int) -> "ModelLeft":
        """What a file says, see `to_dict`.

        Args:
            given: Its table.
            joints: Indices (p,) of the joints, in the order of the springs.
            n: Number of joints of the robot.

        Raises:
            ValueError: A number is missing, or none.
        """
        pieces, possible = possible_from_dict(given, len(joints), n)
        dof = np.inf if given.get("dof") is None else float(not_negative_of(given, "dof", ()))
        order = given.get("beside")
        a = len(order) if isinstance(order, list) else 0
        beside = numbers_of(given, "beside", (a, a))
        noise = numbers_of(given, "noise", (len(joints), len(joints)))
        constant = float(not_negative_of(given, "constant", ()))
        return cls(joints, pieces, possible, noise, beside, constant, dof)


@dataclass(frozen=True, eq=False)
class PiecesLeft:
    """Parameters, and pieces that the springs lack, that readings under loads leave possible.

    Attributes:
        names: The parameters (p,).
        pieces: What may be missing.
        possible: Their sizes, and errors of the parameters in their units, true less identified.
        shares: The likeliest shares of the pieces, by name [%].
        drawing: What share of the model's error, as the fit has it, is the drawing's: it comes anew
            in each pose, whatever loads it.
        noise: Covariance (p, p) of the parameters in their units by readings and drawing alone;
            None of a file of before, which had that of the fit.
    """

    names: tuple[str, ...]
    pieces: MissingPieces
    possible: PossibleSprings
    shares: Mapping[str, float] = field(default_factory=dict)
    drawing: float = 1.0
    noise: Array | None = None

    @property
    def counts(self) -> bool:
        """Whether the sheet speaks for a piece."""
        return any(self.shares.values())

    @classmethod
    def of(cls, setting: StudyGeometry, fit: GeometricFit) -> "PiecesLeft | None":
        """Tell them from the residuals of readings under loads, and what else is known.

        A difference of two readings shows pieces and noise. In an absolute one there are errors of
        the drawing, too, which no load changes. The fit took all that is left for such errors.
        Beside the pieces they are of the size at which the residuals are likeliest.

        Returns:
            What is left; None where no load bends the robot, or other springs than those of the
            joints are among the parameters, or the study says that its model is exact.
        """
        fitted = fit.fitted
        told = not fitted.noise.unknown and not fitted.open_parameters
        usual = usual_share(setting.study)
        if setting.loads is None or setting.elastic or not usual or not told:
            return None
        seen = _Loaded.of(setting, setting.loads, fit)
        if seen is None:
            return None
        shares = (1.0,) if fit.data.means.is_difference.all() else OF_DRAWING
        if not fitted.noise.draws:
            shares = shares[:1]
        every = [(seen.posterior(share, usual), share) for share in shares]
        likely = [(*found, share) for found, share in every if found is not None]
        if not likely:
            return None
        posterior, _, drawing = max(likely, key=lambda one: one[1])
        possible = posterior.possible(np.zeros(fitted.model.p))
        names = tuple(one.name for one in fitted.model.parameters)
        return cls(names, seen.pieces, possible, posterior.shares, drawing, posterior.alone)

    def apart(self, fitted: FittedGeometry) -> FittedGeometry:
        """The identified robot, which errs by readings and the drawing alone."""
        noise = fitted.noise.of_drawing(self.drawing)
        if self.noise is None:
            return replace(fitted, noise=noise)
        kept = self._own(fitted)
        return replace(fitted, noise=noise, covariance=self.noise[np.ix_(kept, kept)])

    def _own(self, fitted: FittedGeometry) -> list[int]:
        """Which of the parameters a robot has, that may lack those of markers."""
        return [self.names.index(one.name) for one in fitted.model.parameters]

    def mixture(
        self, fitted: FittedGeometry, model: ElastostaticModel, q: Array, wrench: Array, J: Array
    ) -> NormalMixture:
        """Errors (t, r) of tool or markers in poses, by parameters and pieces [m].

        Args:
            fitted: The robot with that tool, or with the markers.
            model: The same drawing under wrenches.
            q: Poses (t, n) [rad or m].
            wrench: Loads (t, 6) [N, N m].
            J: Columns (t, r, p) of its parameters [mm a unit].
        """
        c = self.pieces.count
        some = [*range(c), *(c + i for i in self._own(fitted))]
        own = replace(
            self.possible,
            mean=self.possible.mean[:, some],
            covariance=self.possible.covariance[:, some][:, :, some],
        )
        at = replace(model, sensors=_markers(fitted.model))
        # A root mean square over the markers.
        root = np.sqrt(len(fitted.model.markers))
        columns = self.pieces.columns(at, q, wrench).mapped(
            lambda one: _in_frame(fitted.model, one) / root
        )
        mean, V = own.errors(columns, J / MM / root)
        return NormalMixture(own.weights, mean, V)

    def in_tasks(self, setting: StudyGeometry, fitted: FittedGeometry) -> "LeftInTasks | None":
        """What is left in the study's tasks; None without one, or where markers count.

        Args:
            setting: The study.
            fitted: The identified robot.
        """
        tasks = setting.study.tasks
        if not tasks or any(task.tool is None for task in tasks):
            return None
        squares, moved, parts = [], [], []
        for task in tasks:
            assert task.tool is not None
            loads = setting.every_load_of(task)
            robot = self.apart(fitted.at_tool(task.tool)).under(loads, setting.untold(loads))
            q = np.atleast_2d(task.q)
            wrench = np.tile(task.wrench, (len(q), 1))
            moves = robot.moves(q, wrench, loads)
            J, kept = moves[2][:, :ROWS], slice(0, ROWS)
            beside = robot.beside(q, wrench, moves)[:, kept, kept] / MM**2
            found = self.mixture(robot, loads.by_wrench, q, wrench, J).plus(beside)
            own = J @ robot.covariance @ np.swapaxes(J, 1, 2) / MM**2 + beside
            squares.append([np.square(found.size).mean(), np.einsum("trr->t", own).mean()])
            at = replace(loads.by_wrench, unknown=None)
            moved.append(np.linalg.norm(at.regressor(q, wrench) @ self.pieces.k) ** 2)
            parts.append(found)
        total, exact = tasks.shares @ np.array(squares)
        before = float(np.sqrt(tasks.shares @ np.array(moved)))
        model = float(np.sqrt(max(total - exact, 0.0)))
        return LeftInTasks(tasks, tuple(parts), float(np.sqrt(total)), model, before)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers; parameters in their units."""
        table = possible_to_dict(self.pieces, self.possible)
        noise = {} if self.noise is None else {"noise": [_short(row) for row in self.noise]}
        return {"names": list(self.names), "drawing": self.drawing, **noise, **table}

    @classmethod
    def from_dict(cls, given: Mapping[str, Any], names: tuple[str, ...], n: int) -> "PiecesLeft":
        """What a file says, see `to_dict`.

        Args:
            given: Its table.
            names: Names of the parameters of the result.
            n: Number of joints.

        Raises:
            ValueError: It is not valid.
        """
        if given.get("names") != list(names):
            raise ValueError("names: expected those of the parameters")
        pieces, possible = possible_from_dict(given, len(names), n)
        # Files of before had pieces of differences alone, of which the drawing is no part.
        drawing = float(not_negative_of({"drawing": 1.0, **given}, "drawing", ()))
        p = len(names)
        noise = numbers_of(given, "noise", (p, p)) if "noise" in given else None
        return cls(names, pieces, possible, drawing=drawing, noise=noise)


@dataclass(frozen=True, eq=False)
class _Loaded:
    """What the readings of a sheet show of pieces.

    Attributes:
        noise: The errors of a pose, as they were fitted.
        rows: Residuals and columns of the parameters.
        same: Of which visits these are.
        pieces: What may be missing.
        columns: What they show.
    """

    noise: PositionNoise
    rows: PoseRows
    same: SamePoses
    pieces: MissingPieces
    columns: MissingColumns

    @classmethod
    def of(cls, setting: StudyGeometry, loads: StudyLoads, fit: GeometricFit) -> "_Loaded | None":
        """Of a fit; None where no wrench turns a spring."""
        fitted, means = fit.fitted, fit.data.means
        before = None
        if fit.told_before is not None:
            before = known_before(fit.told_before.prior, fitted.model, fitted.theta)
        torque = loading_of(fitted.bending, means, loads)
        rows = PoseRows.of(fitted.model, fitted.theta, means, torque, before)
        # What is known besides has rows of no pose behind those that are read, see `PoseRows`.
        q, wrench = (_with_none(one, rows.beside) for one in (means.q, means.wrench))
        there = _with_none(means.rows_seen, rows.beside).reshape(len(q), -1, 1)
        model = replace(loads.by_wrench, sensors=_instruments(fitted.model))
        loaded = np.flatnonzero(means.wrench.any(axis=1))
        turned = model.torque_of(model.frames(means.q[loaded]), means.wrench[loaded])
        if not (fitted.compliances[:, None] * turned).any():
            return None
        pieces = MissingPieces.of(model.robot, fitted.compliances, turned.T)

        def as_read(columns: Array) -> Array:
            return MM * _as_read(fitted.model, columns) * there

        shown = pieces.columns(model, q, wrench).mapped(as_read)
        tilt = np.deg2rad(setting.study.specification.uncertainty.load_direction_deg)
        moved = np.moveaxis(_tilted(model, q, wrench) @ fitted.compliances, 0, -1)
        same = means.same_poses
        # A stiffness that varies with the position is the same under all loads of a pose.
        pose = np.append(same.pose, 1 + same.pose.max() + np.arange(rows.beside))
        columns = MissingColumns(shown, pose, tilt * as_read(moved))
        return cls(fitted.noise, rows, same, pieces, columns)

    def posterior(self, drawing: float, usual: float) -> "tuple[SizePosterior, float] | None":
        """Pieces beside errors of the drawing of a share, and the logarithm of its likelihood."""
        V = self.rows.errors(self.noise.of_drawing(drawing))
        noise = self._of_visits(V.dense)
        found = SizeLikelihood.of(*self._visits, noise, self.columns, usual).posterior
        return None if found is None else (found, found.evidence - V.inverse.log_det / 2)

    @cached_property
    def _visits(self) -> tuple[Array, Array]:
        """Columns (m, r, p) and residuals (m, r) of the visits: friction holds a part in each."""
        m = len(self.same.pose)
        rows = np.concatenate([self.rows.design, self.rows.residual[..., None]], axis=-1)
        by_marker = rows[:m].reshape(*self.same.worth.shape, -1)
        rows[:m] = self.same.back(by_marker).reshape(rows[:m].shape)
        return rows[..., :-1], rows[..., -1]

    def _of_visits(self, V: Array) -> CorrelatedNoise:
        """Their errors, of covariances (m, r, r) of independent rows."""
        m = len(self.same.pose)
        blocks = [NoiseBlocks(np.arange(m, len(V))[:, None], V[m:])] if len(V) > m else []
        for visits, together in self.same.together(V):
            unread = np.einsum("gii->gi", together) == 0
            read = together + unread[..., None] * np.eye(unread.shape[1])
            blocks.append(NoiseBlocks(visits, read))
        return CorrelatedNoise.of(blocks, V.shape[:2])


@dataclass(frozen=True, eq=False)
class LeftInTasks:
    """Errors in the tasks after a compensation, with what a model leaves out [m].

    Attributes:
        tasks: The tasks.
        parts: The errors in the poses of each.
        total: Root mean square, by parameters and model.
        model: What the model makes of it.
        before: The displacement without compensation.
    """

    tasks: Tasks
    parts: tuple[NormalMixture, ...]
    total: float
    model: float
    before: float

    @cached_property
    def chance(self) -> float:
        """Chance of an error of more than twice the total."""
        twice = np.array([2 * self.total])
        return float(self.tasks.shares @ np.array([one.beyond(twice)[0] for one in self.parts]))

    @cached_property
    def most(self) -> float:
        """The error that is exceeded with a chance of 2.5 %, in the worst task [m]."""
        return max(float(one.quantiles([TOLD_CHANCE])[0, 0]) for one in self.parts)

    def findings(self, shares: Mapping[str, float], counts: bool) -> Iterator[Finding]:
        """Name errors of the model: those that are found, and those that the sheet leaves possible.

        What is missing is a note where it makes little of the total, or a good compensation bad.

        Args:
            shares: The likeliest shares of the pieces that the model lacks [%].
            counts: Whether the sheet speaks for one.
        """
        place = self.tasks.place
        if counts and self.model >= SHARE * self.total:
            large = 2 * self.model**2 > self.total**2 and self.total > LARGE * self.before
            severity = Severity.WARNING if large else Severity.NOTE
            found: dict[str, Any] = {"model": self.model, "place": place, **shares}
            yield Finding.of(severity, WORDING, "model_error", **found)
        if self.chance > OFTEN:
            untold = {"chance": self.chance, "most": self.most, "total": self.total}
            yield Finding.of(Severity.WARNING, WORDING, "model_untold", place=place, **untold)


def possible_to_dict(pieces: MissingPieces, possible: PossibleSprings) -> dict[str, Any]:
    """Pieces and what is possible of them, as plain numbers in SI units, and shares."""
    lower = np.tril_indices(possible.mean.shape[1])
    return {
        "compliance": pieces.k.tolist(),
        "load": pieces.load.tolist(),
        "links": list(pieces.links),
        "weights": possible.weights.tolist(),
        "held": possible.held.tolist(),
        "turn": possible.turn.tolist(),
        "mean": [_short(row) for row in possible.mean],
        "covariance": [_short(one[lower]) for one in possible.covariance],
    }


def possible_from_dict(
    given: Mapping[str, Any], p: int, n: int
) -> tuple[MissingPieces, PossibleSprings]:
    """What a file says of p parameters and n joints, see `possible_to_dict`.

    Raises:
        ValueError: A number is missing, or none.
    """
    # Files of before had no springs in the middles of links.
    links = given.get("links", [])
    if not isinstance(links, list) or any(one not in range(1, n) for one in links):
        raise ValueError(f"links: expected a list of joints from 1 to {n - 1}, counted from 0")
    k, load = (not_negative_of(given, name, (n,)) for name in ("compliance", "load"))
    pieces = MissingPieces(k, load, tuple(links))
    rows = given.get("weights")
    s = len(rows) if isinstance(rows, list) else 0
    order = pieces.count + p
    weights = not_negative_of(given, "weights", (s,))
    if not weights.sum() > 0:
        raise ValueError("weights: expected a number that is not zero")
    lower = np.tril_indices(order)
    covariance = np.zeros((s, order, order))
    covariance[:, lower[0], lower[1]] = numbers_of(given, "covariance", (s, len(lower[0])))
    whole = covariance + np.swapaxes(np.tril(covariance, -1), 1, 2)
    if not is_semidefinite(whole).all():
        raise ValueError("covariance: expected covariances, without negative eigenvalues")
    # Files of before had what friction holds of one size.
    held = not_negative_of({"held": [GIVES] * s, **given}, "held", (s,))
    turn = not_negative_of(given, "turn", (s,))
    mean = numbers_of(given, "mean", (s, order))
    return pieces, PossibleSprings(weights / weights.sum(), held, turn, mean, whole)


def _short(numbers: Array) -> list[float]:
    """Numbers with so many digits as are written."""
    return [float(f"{x:.{WRITTEN_DIGITS}g}") for x in numbers.tolist()]


def _tilted(model: ElastostaticModel, q: Array, wrench: Array) -> Array:
    """Regressors (3, m, 3k, n) under loads turned about each axis of the world [1/rad]."""
    every = replace(model, unknown=None)
    return np.stack([every.regressor(q, one) for one in load_turns(wrench)])


def _markers(model: MeasuredModel) -> tuple[Marker, ...]:
    """Markers at the places of all instruments, on the bodies of the drawing."""
    pairs = zip(model.offsets, model.bodies, strict=True)
    return tuple(Marker(BodyPoint(np.asarray(offset), body)) for offset, body in pairs)


def _instruments(model: MeasuredModel) -> tuple[Sensor, ...]:
    """What reads them there."""
    assert model.anchors is not None
    found: list[Sensor] = []
    for kind, marker, anchor in zip(model.kinds, _markers(model), model.anchors, strict=True):
        others = {
            "pose": PoseMarker(marker.point),
            "distance": Distance(marker.point, anchor=anchor),
        }
        found.append(others.get(kind, marker))
    return tuple(found)


def _as_read(model: MeasuredModel, columns: Array) -> Array:
    """Columns (m, k rows, c) as the model has them, of those (m, r, c) of its instruments.

    Positions and orientations are in the axes of the instrument, distances in none.
    """
    every = np.zeros((len(columns), model.present.size, columns.shape[-1]))
    every[:, model.present.reshape(-1)] = columns
    of_distance = np.repeat(model.is_distance, model.row_count)[:, None]
    return np.where(of_distance, every, _in_frame(model, every))


def _with_none(visits: Array | Mask, more: int) -> Array:
    """Visits (m, ...) and so many more, of zeros."""
    return np.concatenate([visits, np.zeros_like(visits, shape=(more, *visits.shape[1:]))])


def _in_frame(model: MeasuredModel, columns: Array) -> Array:
    """Columns (m, 3k, c) in the axes of the instrument, of those in the world's."""
    R = model.start[:ROWS, :ROWS]
    m, rows, c = columns.shape
    return (R @ columns.reshape(m, rows // ROWS, ROWS, c)).reshape(m, rows, c)


PARTS = {
    "across_percent": "springs across the joints of {:.2g} % of their own",
    "held_percent": "friction of {:.2g} % of the loads",
    "turn_percent": "stiffnesses that vary by {:.2g} % from pose to pose",
}


def _model_error(data: Data) -> str:
    """What was found."""
    parts = [words.format(data[name]) for name, words in PARTS.items() if data[name]]
    size = f"{1e3 * data['model']:.2g} mm {data['place']}"
    return (
        f"the residuals look as if the robot had {', '.join(parts)}, which its model lacks: the "
        f"expected error counts {size} for that"
    )


def _model_untold(data: Data) -> str:
    """What is assumed."""
    chance = f"{100 * data['chance']:.0f} %"
    return (
        "these poses and loads do not tell friction and springs that the model lacks; with usual "
        f"ones, {chance} of such days end more than {1e3 * 2 * data['total']:.2g} mm off "
        f"{data['place']}, twice the error expected, and up to {1e3 * data['most']:.2g} mm off; "
        "other poses, and loads of other sizes, would tell"
    )


WORDING: Wording = {"model_error": _model_error, "model_untold": _model_untold}
