"""What a study of geometry says of its robot: model, noise and loads."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.cell.sight import Sight
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.prior import Gaussian
from edtk.fit.sheet import Reference
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.instruments.pose_marker import COORDINATES
from edtk.measure.measured_model import Kind, Load, MeasuredModel
from edtk.measure.noise import VisitNoise
from edtk.measure.parameters import Parameter, all_parameters
from edtk.measure.position_noise import PositionNoise
from edtk.measure.springs import elastic_joints, sprung
from edtk.measure.task import ErringColumns, Task
from edtk.robots.elastic_robot import ElasticJoint, point_of, turning_about, weights_of
from edtk.robots.frames import Frames
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.robots.weights import GRAVITY, Counted, DeadWeights, torque_derivative
from edtk.study.study import Study
from edtk.study.study_model import (
    compensator_numbers,
    distance_names,
    giving_way,
    instrument_kinds,
    is_reference,
    left_out,
    likely_compliances,
    marker_names,
    on_robot,
    other_springs,
    own_weights,
    promised_table,
    with_likely_sizes,
)
from edtk.study.study_sight import sight_by_name
from edtk.study.tables_of_measurement import DistanceTable, MarkerTable
from edtk.system.typing import Array, Indices, Mask

STEP = 0.1  # [rad or m]: the mark's pose has its joints at 1, 2, 3, ... steps


@dataclass(frozen=True, eq=False)
class StudyGeometry:
    """A study of geometry, and the markers that its sheet has.

    Attributes:
        study: The question.
        markers: Names of the instruments: markers on the tool, those on links, then distances. All
            are those of the study, or where it names none, those of the sheet.
        references: Names of those on the base.
    """

    study: Study
    markers: tuple[str, ...]
    references: tuple[str, ...]

    @classmethod
    def of(cls, study: Study, sheet_markers: tuple[str, ...] = ()) -> "StudyGeometry":
        """The markers of a study, or those of a sheet where the study names none."""
        given = study.specification.marker
        names = marker_names(study)
        pairs = list(zip(given, names, strict=True))
        moved = [(one, name) for one, name in pairs if not is_reference(study, one)]
        moved.sort(key=lambda pair: pair[0].joint is not None)
        named = (*(name for _, name in moved), *distance_names(study))
        return cls(
            study,
            named or sheet_markers or ("marker",),
            tuple(name for one, name in pairs if is_reference(study, one)),
        )

    @classmethod
    def of_result(cls, study: Study, result_markers: object) -> "StudyGeometry":
        """With the markers that a result has, which may be some of the study's."""
        names = tuple(map(str, result_markers)) if isinstance(result_markers, list) else ()
        setting = cls.of(study, names)
        some = names and set(names) <= set(setting.markers)
        return replace(setting, markers=names) if some else setting

    @property
    def full_poses(self) -> bool:
        """Whether orientations of any marker are measured with the positions."""
        return bool(self.turned)

    @property
    def turned(self) -> tuple[str, ...]:
        """Markers whose orientations are measured with the positions."""
        return tuple(name for name in self.markers if self.kinds.get(name) == "pose")

    @cached_property
    def distances(self) -> dict[str, DistanceTable]:
        """The distances, by name."""
        return dict(zip(distance_names(self.study), self.study.specification.distance, strict=True))

    @cached_property
    def kinds(self) -> dict[str, Kind]:
        """What is read of each instrument, by name; of a sheet's own the usual."""
        usual = self.study.specification.measurement.rows
        return dict.fromkeys(self.markers, usual) | instrument_kinds(self.study)

    @property
    def reference(self) -> Reference:
        """What readings are counted from: differences may be from the nominal robot."""
        return "nominal" if self.study.is_absolute else "instrument"

    @property
    def read(self) -> dict[str, Kind]:
        """The same of those that a sheet has, points on the base last; none where it names them."""
        given = self.study.specification
        names = (*self.markers, *self.references) if given.marker or given.distance else ()
        return {name: self.kinds[name] for name in names}

    @cached_property
    def _points(self) -> dict[str, MarkerTable | DistanceTable]:
        """What says where each instrument is: of a distance that ends at a marker, the marker."""
        markers = {name: one for one, name in on_robot(self.study)}
        ends = {
            name: one if one.marker is None else markers[one.marker]
            for name, one in self.distances.items()
        }
        return {**markers, **ends}

    @cached_property
    def bodies(self) -> dict[str, str]:
        """Names of joints on whose bodies markers are, by marker; the others are on the tool."""
        every = self._points.items()
        return {name: one.joint for name, one in every if one.joint is not None}

    @property
    def on_tool(self) -> tuple[str, ...]:
        """The markers on the tool, which come first."""
        return tuple(
            name for name in self.markers if name not in self.bodies and name not in self.distances
        )

    @property
    def reads_changes(self) -> bool:
        """Whether visits under a load are read as a loaded position less an unloaded one."""
        return self.study.kind.is_paired(self.study)

    @property
    def model(self) -> MeasuredModel:
        """The model with all parameters that the study asks for."""
        study = self.study
        names = self.markers
        asked = study.kind.parameters(study)
        joints = study.specification.joints
        parameters = all_parameters(
            study.robot,
            self._placed,
            asked.geometry,
            (*joints.unknown, *self.uncertain),
            asked.base,
            asked.tool,
            self.turned,
            {name: one.compliance for name, one in likely_compliances(study).items()},
            self.bodies,
            (*self.springs, *compensator_numbers(study)),
        )
        offsets = {name: np.array(one.position_mm) for name, one in self._points.items()}
        anchors = {name: np.array(one.anchor_mm) for name, one in self.distances.items()}
        bodies = {name: study.robot.body_names.index(joint) for name, joint in self.bodies.items()}
        exact = {
            j: k for j, k in study.known.items() if study.robot.joint_names[j] not in self.uncertain
        }
        known = np.zeros(study.robot.n)
        known[list(exact)] = list(exact.values())
        return MeasuredModel(
            study.robot,
            np.array([offsets.get(name, np.zeros(3)) for name in names]) / 1e3,
            names,
            parameters,
            rows="pose" if self.full_poses else "position",
            bodies=tuple(bodies.get(name) for name in names),
            kinds=tuple(self.kinds[name] for name in names),
            anchors=np.array([anchors.get(name, np.zeros(3)) for name in names]) / 1e3,
            places=tuple(
                names.index(self._ends_at(name)) if self._ends_at(name) in names else i
                for i, name in enumerate(names)
            ),
            known=known if exact else None,
            elastic=self.elastic,
            gives=giving_way(study),
        )

    @cached_property
    def springs(self) -> tuple[Parameter, ...]:
        """The springs that the study asks for besides the joints' own."""
        return with_likely_sizes(self.study, other_springs(self.study))

    @cached_property
    def elastic(self) -> tuple[ElasticJoint, ...]:
        """The elastic joints of these, in the frames before the joints."""
        return elastic_joints(self.study.robot, self.springs)

    def _ends_at(self, name: str) -> str:
        """The instrument whose place on the robot another one has: its own, as a rule."""
        marker = self.distances[name].marker if name in self.distances else None
        return name if marker is None else marker

    @property
    def _placed(self) -> tuple[str, ...]:
        """The instruments that have places of their own."""
        return tuple(
            name
            for name in self.markers
            if self._ends_at(name) == name or self._ends_at(name) not in self.markers
        )

    @property
    def uncertain(self) -> dict[str, Gaussian]:
        """Known compliances that may be off, by joint: parameters of which something is known."""
        known = self.study.specification.joints.known
        return {
            name: Gaussian(one.value, one.deviation)
            for name, one in known.items()
            if one.deviation > 0
        }

    @property
    def taken_as_drawn(self) -> tuple[Parameter, ...]:
        """Errors of the drawing that the study does not ask for, and that a robot may have."""
        asked = {one.name for one in self.model.parameters}
        every = all_parameters(self.study.robot, self._placed, pose=self.turned)
        return tuple(one for one in every if one.name not in asked)

    @property
    def noise(self) -> PositionNoise:
        """The stated noise of a reading [mm, mrad]; its tracker stands in the world."""
        turn = None
        if self.full_poses:
            turn = 1e3 * float(np.deg2rad(self.study.specification.measurement.sigma_deg or 0.0))
        study = self.study
        sigma = study.specification.measurement.sigma_mm or 0.0  # it is part of the tracker's
        table = study.specification.noise
        stated = {} if table is None else table.reading(study.robot.units)
        own = [self.distances[name] for name in self.markers if name in self.distances]
        ratios = None
        if any(one.sigma_mm is not None for one in own):
            sizes = {name: one.sigma_mm or sigma for name, one in self.distances.items()}
            unit = sigma or min(sizes.values())
            ratios = np.array([sizes.get(name, sigma) for name in self.markers]) / unit
            sigma = unit
        plain = PositionNoise(
            sigma, np.zeros(study.robot.n), turn=turn, tracked=self.tracked, ratios=ratios
        )
        return plain.beside(**stated)

    @property
    def tracked(self) -> Mask | None:
        """Which instruments (k,) a tracker sees; None for all: it reads no distance."""
        distances = self.model.is_distance
        return ~distances if distances.any() else None

    @cached_property
    def sight(self) -> Sight | None:
        """Which of the instruments are read in which poses; None for all."""
        if self.study.sight is None:
            return None
        model = self.model
        return sight_by_name(self.study.sight, self.markers, model.row_count)

    @property
    def loads(self) -> "StudyLoads | None":
        """What loads the joints; None where no spring is asked for, or known."""
        joints = self.study.specification.joints
        asked = joints.unknown or joints.known or self.springs
        return self.every_load if asked else None

    @property
    def every_load(self) -> "StudyLoads":
        """The same whether or not springs are asked for: joints bend all the same."""
        loads = StudyLoads.of(self.study, self.elastic)
        return replace(loads, reads_changes=self.reads_changes)

    def untold(self, loads: "StudyLoads") -> "StudyLoads":
        """What of some loads bends joints that are not identified, and no reading tells.

        Where no spring is asked for, or known, what the links' weights bend is in all readings, and
        residuals show what the parameters leave of it.
        """
        return replace(loads, links=None) if self.loads is None else loads

    def loads_of(self, task: Task) -> "StudyLoads | None":
        """What loads the joints in a task; None where no spring is asked for."""
        return None if self.loads is None else self.every_load_of(task)

    def every_load_of(self, task: Task) -> "StudyLoads":
        """The same whether or not springs are asked for.

        A task without a tool and a payload is a visit: loaded where those of a sheet are, and with
        the study's own payload. Any other is loaded at its tool point, and carries what it says.
        """
        loads = self.every_load
        robot = sprung(task.placed, self.elastic)
        weights = weights_of(robot, task.dead_weights)
        if task.tool is None:
            own = replace(loads, links=weights, payload=None)
            return own if task.carries else loads
        return StudyLoads(ElastostaticModel(robot, loads.by_wrench.unknown), weights, None)

    def columns(
        self, task: Task, model: MeasuredModel, loads: "StudyLoads | None" = None
    ) -> ErringColumns:
        """How what counts in a task moves with a model's parameters, about the drawing.

        Args:
            task: The task.
            model: Markers and parameters.
            loads: What loads the joints; by default what does where springs are asked for.
        """
        loads = self.loads_of(task) if loads is None else loads

        def torque(q: Array) -> Load | None:
            if loads is None:
                return None
            return model.brought(q, loads(q, np.tile(task.wrench, (len(q), 1))))

        return ErringColumns(model, np.zeros(model.p), task.tool, torque)

    def as_positions(self, data: MarkerPositions) -> MarkerPositions:
        """Displacements from the nominal robot as absolute positions; all others stay."""
        if data.differs is None or not self.study.is_absolute:
            return data
        drawn = self.model.see(np.zeros(self.model.p), data.q, derivatives=False)
        k = len(self.markers)
        own = data.is_difference[:, None, None]
        measured, turns = data.measured.copy(), data.turns
        measured[:, :k] += np.where(own, drawn.points, 0.0)
        if turns is not None:
            turns = turns.copy()
            turns[:, :k] = np.where(own[..., None], turns[:, :k] @ drawn.turns, turns[:, :k])
        return replace(data, measured=measured, turns=turns, differs=None)

    def split(self, data: MarkerPositions) -> tuple[MarkerPositions, MarkerPositions]:
        """Positions of the markers on the tool, and of the references."""
        k = len(self.markers)
        tool = replace(data.of_markers(slice(0, k)), markers=self.markers)
        return tool, replace(data.of_markers(slice(k, None)), markers=self.references)


def planned_noise(setting: StudyGeometry, promised: bool = False) -> VisitNoise:
    """The errors of a visit that plans count: those of a reading, and what the model leaves out.

    A sheet tells the second itself. In a difference of two readings it is as large as in one.

    Args:
        setting: The study.
        promised: Whether it is for the error that is expected, and not for poses: then what springs
            likely leave out counts where the study says nothing of that.
    """
    model, study = setting.model, setting.study
    width = model.row_count * len(model.markers)
    noise = replace(setting.noise.of_visits(width, len(model.markers)), change=None)
    table = promised_table(study) if promised else study.specification.noise
    if table is None:
        return noise
    lengths = np.arange(width) % model.row_count < COORDINATES
    own = left_out(study, table, lengths, springs=setting.loads is not None, unit=noise.unit)
    return replace(noise, **own, groups=_groups(model))


def _groups(model: MeasuredModel) -> Indices:
    """Groups (k r,) of rows: those of a position, of an orientation, or a distance by itself."""
    rows = np.arange(model.row_count)
    own = np.where(model.is_distance[:, None], rows, rows // COORDINATES)
    return np.asarray(own + model.row_count * np.arange(len(own))[:, None]).reshape(-1)


def alone_load(study: Study) -> Array | None:
    """The study's only load (6,), that of a displacement where a sheet names none; None else."""
    given = study.specification
    if given.load is None and given.payload is None:
        return None
    load = given.build_load()
    return load.always if isinstance(load, FixedLoad) else None


@dataclass(frozen=True, eq=False)
class StudyLoads:
    """Loads of the joints by the wrench of a row, by a payload with it, and by the links always.

    All are of the robot with its elastic joints, whose loads come after those of the others. Poses
    may leave these joints out.

    Attributes:
        by_wrench: The model under a wrench alone.
        links: Weights of the links; None where they are not known.
        payload: The weight that the robot carries where a wrench loads it; None without one.
        reads_changes: Whether plans are for visits that are read loaded less unloaded, where a
            wrench loads them.
    """

    by_wrench: ElastostaticModel
    links: DeadWeights | None
    payload: DeadWeights | None
    reads_changes: bool = False

    @classmethod
    def of(cls, study: Study, elastic: tuple[ElasticJoint, ...] = ()) -> "StudyLoads":
        """Of a study, whose springs need some elastic joints."""
        robot = sprung(study.robot, elastic)
        links, payload = (weights_of(robot, one) for one in own_weights(study))
        bare = replace(study.model, weights=None, own_weights=None, sensors=())
        point = point_of(robot, bare.load_point)
        return cls(replace(bare, robot=robot, load_point=point), links, payload)

    def __call__(self, q: Array, wrench: Array) -> Array:
        """Loads (m, s) of the free joints [N m or N] in poses q (m, n) under wrenches (m, 6)."""
        return self._torque(self._frames(q), wrench)

    def with_derivative(self, q: Array, wrench: Array) -> tuple[Array, Array]:
        """The same, and derivatives ``dtau_j/dq_l`` (m, s, s)."""
        frames = self._frames(q)
        point = self.by_wrench.load_point
        H = torque_derivative(frames, point, wrench, *self._counted(wrench))
        return self._torque(frames, wrench), H

    def _torque(self, frames: Frames, wrench: Array) -> Array:
        """Loads (m, s) in poses whose frames are known."""
        torque = self.by_wrench.torque_of(frames, wrench)
        for weights, share in self._counted(wrench):
            torque = torque + frames.folded(weights.torque(frames)) * share
        return np.ascontiguousarray(torque.T)

    def _counted(self, wrench: Array) -> tuple[Counted, ...]:
        """What loads the joints besides wrenches (m, 6), with the share (m,) that acts."""
        links = () if self.links is None else ((self.links, 1.0),)
        loaded = wrench.any(axis=1).astype(float)
        return links if self.payload is None else (*links, (self.payload, loaded))

    @property
    def pulls(self) -> bool:
        """Whether compensators load the joints in what is read."""
        return not self.reads_changes and self.links is not None and bool(self.links.pulls)

    def largest(self, wrenches: Array) -> float:
        """A bound of the load of any joint, in any pose, under wrenches (s, 6 or 9) [N m or N]."""
        levers = np.linalg.norm(wrenches[:, 6:], axis=1)
        reach = self.by_wrench.reach_of(self.by_wrench.load_point)
        forces, torques = (np.abs(part).sum(axis=1) for part in (wrenches[:, :3], wrenches[:, 3:6]))
        found = float(((reach + levers) * forces + torques + forces).max())
        weights = [one for one in (self.links, self.payload) if one is not None]
        for one in weights:
            arms = [1.0 + self.by_wrench.reach_of(center) for center in one.centers]
            found += GRAVITY * sum(m * arm for m, arm in zip(one.masses, arms, strict=True))
        return found

    def across(self, q: Array, wrench: Array, joint: int, axis: int) -> Array:
        """Loads (m,) about an axis of the frame before a free joint [N m]."""
        frames = turning_about(self.by_wrench.robot, self._frames(q), joint, axis)
        torque = self.by_wrench.torque_of(frames, wrench)[joint]
        for weights, share in self._counted(wrench):
            torque = torque + frames.folded(weights.torque(frames))[joint] * share
        return np.asarray(torque)

    def of_wrench(self, q: Array, wrench: Array) -> Array:
        """Loads (m, s) of the free joints [N m or N] by wrenches (m, 6) alone."""
        return np.ascontiguousarray(self.by_wrench.torque_of(self._frames(q), wrench).T)

    def slope(self, q: Array, wrench: Array, s: Array) -> Array:
        """Derivatives (m, s) of ``sum_j s_j tau_j`` by the free joints, weights s (m, s) fixed."""
        frames = self._frames(q)
        weights = np.ascontiguousarray(s.T)
        slope = self.by_wrench.torque_slope_of(frames, wrench, weights)
        for body, share in self._counted(wrench):
            slope += frames.folded(body.torque_slope(frames, frames.spread(weights) * share))
        return np.ascontiguousarray(slope.T)

    def _frames(self, q: Array) -> Frames:
        """The chain in poses q (m, n), with all bodies that are loaded."""
        weights = [one for one in (self.links, self.payload) if one is not None]
        bodies = {*self.by_wrench.bodies, *(body for one in weights for body in one.bodies)}
        return self.by_wrench.robot.frames(q, tuple(sorted(bodies)))


WRENCH = np.array([100.0, 200.0, 300.0, 10.0, 20.0, 30.0])  # [N, N m]: any one that is not zero


def study_marks(setting: StudyGeometry) -> dict[str, Array]:
    """Numbers that differ where a study counts its joints, or loads them, in another way.

    Predictions rest on more than a result holds: on the controller's signs and zeros, on the place
    where a load acts, and on the weights of payload and links. What these do in one pose is written
    beside the result, so that a study that was changed since is not answered with wrong numbers.

    Returns:
        `shown`: what the controller shows in a pose (n,) [rad or m]; `loads`: loads (2, n) of the
        joints there without a wrench and under one [N m or N], where springs are asked for.
    """
    robot = setting.study.robot
    q = STEP * np.arange(1.0, robot.n + 1)
    marks = {"shown": np.asarray(robot.shown(q))}
    if setting.loads is not None:
        loads = setting.loads(np.stack([q, q]), np.stack([0 * WRENCH, WRENCH]))
        marks["loads"] = loads[:, : robot.n]
    return marks
