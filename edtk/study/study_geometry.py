"""What a study of geometry says of its robot: model, noise and loads."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from edtk.fit.geometry.marker_positions import MarkerPositions
from edtk.fit.prior import Gaussian
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.geometric_model import GeometricModel
from edtk.measure.noise import PositionNoise
from edtk.measure.parameters import GeometricParameter, all_parameters
from edtk.measure.task import ErringColumns, Task
from edtk.robots.frames import Frames
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.robots.weights import DeadWeights
from edtk.study.study import Study
from edtk.study.study_model import (
    is_reference,
    likely_compliances,
    marker_names,
    on_robot,
    own_weights,
)
from edtk.system.typing import Array

STEP = 0.1  # [rad or m]: the mark's pose has its joints at 1, 2, 3, ... steps


@dataclass(frozen=True, eq=False)
class StudyGeometry:
    """A study of geometry, and the markers that its sheet has.

    Attributes:
        study: The question.
        markers: Names of the markers on the robot, those on the tool first: those of the study, or
            where it names none, those of the sheet.
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
        return cls(
            study,
            tuple(name for _, name in moved) or sheet_markers or ("marker",),
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
        """Whether orientations are measured with the positions."""
        return self.study.specification.measurement.rows == "pose"

    @cached_property
    def bodies(self) -> dict[str, str]:
        """Names of joints on whose bodies markers are, by marker; the others are on the tool."""
        return {name: one.joint for one, name in on_robot(self.study) if one.joint is not None}

    @property
    def on_tool(self) -> int:
        """How many of the markers are on the tool; they come first."""
        return sum(name not in self.bodies for name in self.markers)

    @property
    def reads_changes(self) -> bool:
        """Whether visits under a load are read as a loaded position less an unloaded one."""
        measurement = self.study.specification.measurement
        return measurement.reference == "unloaded" and "reference" in measurement.model_fields_set

    @property
    def model(self) -> GeometricModel:
        """The model with all parameters that the study asks for."""
        study = self.study
        asked = study.kind.parameters(study)
        joints = study.specification.joints
        offsets = {name: np.array(one.position_mm) / 1e3 for one, name in on_robot(study)}
        parameters = all_parameters(
            study.robot,
            self.markers,
            asked.geometry,
            (*joints.unknown, *self.uncertain),
            asked.base,
            asked.tool,
            self.full_poses,
            {name: one.compliance for name, one in likely_compliances(study).items()},
            self.bodies,
        )
        places = np.array([offsets.get(name, np.zeros(3)) for name in self.markers])
        rows: Literal["position", "pose"] = "pose" if self.full_poses else "position"
        places_of = {
            name: study.robot.body_names.index(joint) for name, joint in self.bodies.items()
        }
        exact = {
            j: k for j, k in study.known.items() if study.robot.joint_names[j] not in self.uncertain
        }
        known = np.zeros(study.robot.n)
        known[list(exact)] = list(exact.values())
        return GeometricModel(
            study.robot,
            places,
            self.markers,
            parameters,
            rows=rows,
            bodies=tuple(places_of.get(name) for name in self.markers),
            known=known if exact else None,
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
    def taken_as_drawn(self) -> tuple[GeometricParameter, ...]:
        """Errors of the drawing that the study does not ask for, and that a robot may have."""
        asked = {one.name for one in self.model.parameters}
        every = all_parameters(self.study.robot, self.markers, pose=self.full_poses)
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
        joints = np.zeros(study.robot.n)
        if table is not None:
            joints = 1e3 * table.repeatability(study.robot.units) * np.ones(study.robot.n)
        tracker = None if table is None else table.tracker()
        tracked = None if tracker is None else ~self.model.is_distance
        return PositionNoise(sigma, joints, turn=turn, tracker=tracker, tracked=tracked)

    @property
    def loads(self) -> "StudyLoads | None":
        """What loads the joints; None where no spring is asked for, or known."""
        joints = self.study.specification.joints
        if not joints.unknown and not joints.known:
            return None
        return replace(StudyLoads.of(self.study), reads_changes=self.reads_changes)

    def loads_of(self, task: Task) -> "StudyLoads | None":
        """What loads the joints in a task.

        A task without a tool and a payload is a visit: loaded where those of a sheet are, and with
        the study's own payload. Any other is loaded at its tool point, and carries what it says.
        """
        if self.loads is None or (task.tool is None and not task.carries):
            return self.loads
        if task.tool is None:
            return replace(self.loads, links=task.dead_weights, payload=None)
        at_tool = ElastostaticModel(task.placed, self.loads.by_wrench.unknown)
        return StudyLoads(at_tool, task.dead_weights, None)

    def columns(self, task: Task, model: GeometricModel) -> ErringColumns:
        """How what counts in a task moves with a model's parameters, about the drawing."""
        loads = self.loads_of(task)

        def torque(q: Array) -> Array | None:
            return None if loads is None else loads(q, np.tile(task.wrench, (len(q), 1)))

        return ErringColumns(model, np.zeros(model.p), task.tool, torque)

    def split(self, data: MarkerPositions) -> tuple[MarkerPositions, MarkerPositions]:
        """Positions of the markers on the tool, and of the references."""
        k = len(self.markers)
        tool = replace(data.of_markers(slice(0, k)), markers=self.markers)
        return tool, replace(data.of_markers(slice(k, None)), markers=self.references)


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
    def of(cls, study: Study) -> "StudyLoads":
        """Of a study."""
        links, payload = own_weights(study)
        model = replace(study.model, weights=None, own_weights=None, sensors=())
        return cls(model, links, payload)

    def __call__(self, q: Array, wrench: Array) -> Array:
        """Loads (m, n) of the free joints [N m or N] in poses q (m, n) under wrenches (m, 6)."""
        frames = self._frames(q)
        torque = self.by_wrench.torque_of(frames, wrench)
        loaded = wrench.any(axis=1)
        if self.links is not None:
            torque = torque + frames.folded(self.links.torque(frames))
        if self.payload is not None:
            torque = torque + frames.folded(self.payload.torque(frames)) * loaded
        return np.ascontiguousarray(torque.T)

    def slope(self, q: Array, wrench: Array, s: Array) -> Array:
        """Derivatives (m, n) of ``sum_j s_j tau_j`` by the free joints, weights s (m, n) fixed."""
        frames = self._frames(q)
        weights = np.ascontiguousarray(s.T)
        slope = self.by_wrench.torque_slope_of(frames, wrench, weights)
        loaded = wrench.any(axis=1)
        for body, counts in ((self.links, 1.0), (self.payload, loaded)):
            if body is not None:
                slope += frames.folded(body.torque_slope(frames, frames.spread(weights) * counts))
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
        marks["loads"] = setting.loads(np.stack([q, q]), np.stack([0 * WRENCH, WRENCH]))
    return marks
