"""What a study of geometry asks of a plan, and the setting of its designs."""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

import criteria
from edtk.calibration.geometry_space import GeometrySpace, PositionRows
from edtk.calibration.told_before import design_prior
from edtk.cell.sight import Sight
from edtk.certificate.certificate import (
    feasible_to_dict,
    gives_to_dict,
    place_to_dict,
    sight_to_dict,
    weights_to_list,
)
from edtk.design.candidate_source import CandidateSource
from edtk.design.design_space import DesignSpace
from edtk.design.plan import Plan
from edtk.fit.fit_geometry import RANDOM_POSES, told_apart
from edtk.fit.prior import PriorRows
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.parameters import (
    COMPONENTS,
    NUMBERS,
    Identifiable,
    Parameter,
    compensator_names,
)
from edtk.measure.task import Task, Tasks
from edtk.robots.frames import MM, BodyPoint, all_wrenches
from edtk.robots.loads.bounded_load import BoundedLoad
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.robots.loads.free_load import FreeLoad
from edtk.robots.loads.listed_load import ListedLoad
from edtk.robots.loads.load import Load
from edtk.robots.weights import DeadWeights
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry, StudyLoads, planned_noise
from edtk.study.study_model import other_springs
from edtk.study.study_objects import given_parameters
from edtk.system.errors import UserError
from edtk.system.typing import Array

HALF = 0.5  # of the largest load, at which laws of springs differ most from a line
UNTOLD = 1e-6  # [mm] an error in a task that a unit of what no pose tells may make


NONE = np.zeros(6)


def load_of(study: Study) -> Load:
    """What a visit may be loaded with: nothing, one of a list whose first is nothing, or any force.

    Without springs a load tells nothing, and none is alone. Rows A of a visit are affine in its
    load, so that ``<Z, A'A>`` is convex in it: it is largest at an end. Of forces along a direction
    the best weights need none but nothing and the largest one, and their bound holds for all.
    Springs that are not linear are told by loads of several sizes: half of the largest is one more.
    """
    given = study.specification
    others = other_springs(study)
    if not (given.joints.unknown or others) or (given.load is None and given.payload is None):
        return FixedLoad(NONE)
    load = given.build_load()
    if isinstance(load, FixedLoad):
        own = load.always[None]
    elif isinstance(load, ListedLoad):
        own = load.wrenches
    elif isinstance(load, BoundedLoad):
        sizes = np.array([1.0, HALF] if any(one.law for one in others) else [1.0])
        own = sizes[:, None] * load.largest
    else:
        return load
    own = np.unique(own[own.any(axis=1)], axis=0)
    return ListedLoad(all_wrenches(NONE[None], own)) if len(own) else FixedLoad(NONE)


@dataclass(frozen=True, eq=False)
class GeometryQuestion:
    """The question of a study of geometry, for designs.

    Attributes:
        study: The study.
        setting: Its markers, noise and loads.
        wrenches: What visits may be loaded with (s, 6); the first is no load, and the only one
            listed where each visit has a force of its own [N, N m].
        space: The design space. Its parameters are a minimal set: those that feasible poses of the
            study can tell apart under these loads.
        structural: Parameters that any poses could tell, feasible or not.
        shares: How those that feasible poses leave open hang on the others, see `Identifiable`.
        before: What is known besides of all parameters that the study asks for, in their units, as
            far as it counts in designs.
        known: Rows (r, p) of what that says of the parameters of a plan, with errors of size one.
        untold: A sentence for each of these, and for each spring that the study asks for and no
            pose tells.
    """

    study: Study
    setting: StudyGeometry
    wrenches: Array
    space: GeometrySpace
    structural: MeasuredModel
    shares: Identifiable
    before: PriorRows
    known: Array
    untold: tuple[str, ...]

    @classmethod
    def of(cls, study: Study) -> "GeometryQuestion":
        """The question of a study with [parameters].

        Raises:
            UserError: No pose is feasible.
        """
        setting = StudyGeometry.of(study)
        load = load_of(study)
        wrenches = load.wrenches if isinstance(load, ListedLoad) else NONE[None]
        telling = _telling(load, wrenches)
        anywhere = _anywhere(setting.model, telling)
        before = _before(setting, *anywhere)
        told = _told(setting, setting.model, *anywhere, before)
        structural = _with(setting.model, told)
        space = _space(study.space_under(load), structural, setting)
        of_structural = before.of(told.kept)
        feasible = _feasible(space, study, telling)
        shares = _told(setting, structural, *feasible, of_structural, setting.sight)
        return cls(
            study,
            setting,
            wrenches,
            replace(space, geometry=_with(structural, shares)),
            structural,
            shares,
            before,
            of_structural.of(shares.kept).rows,
            (*_springs(setting.model, told), *shares.words),
        )

    @property
    def chooses_forces(self) -> bool:
        """Whether each visit has a force of its own."""
        return isinstance(self.space.load, FreeLoad)

    @property
    def model(self) -> MeasuredModel:
        """Markers, and the parameters of a plan."""
        return self.space.geometry

    @property
    def prior(self) -> Array | None:
        """Information (p, p) that counts beside every plan; None where nothing is known."""
        return self.known.T @ self.known if len(self.known) else None

    def information(self, plan: Plan) -> Array:
        """Information matrix (p, p) of a plan, and of what is known besides."""
        M = self.space.information(plan)
        return M if self.prior is None else M + self.prior

    def cost(self, criterion: criteria.Criterion, plan: Plan) -> float:
        """The cost of a plan, and of what is known besides, by its rows."""
        return self.space.cost(criterion, plan, known=self.prior)

    @cached_property
    def promised(self) -> "GeometryQuestion":
        """The same question with what springs likely leave out, where the study does not say it.

        The error that is expected of a plan rests on it, and its poses do not.
        """
        noise = planned_noise(self.setting, promised=True)
        return replace(self, space=replace(self.space, noise=noise))

    def space_for(self, size: int) -> GeometrySpace:
        """The space of plans of so many visits, which share what is known besides."""
        if self.prior is None:
            return self.space
        return replace(self.space, prior=self.prior / size, sharing=size)

    def rows(self, q: Array, wrench: Array) -> Array:
        """How markers move with the parameters (m, k r, p) [mm, mrad] in poses under wrenches."""
        return PositionRows(self.model, self.setting.loads, sight=self.space.sight)(q, wrench)

    @cached_property
    def tasks(self) -> Tasks:
        """The study's tasks, in which errors of these parameters do harm; there may be none.

        Raises:
            UserError: Something that no feasible pose tells does harm there.
        """
        every = self.every_task
        for i, task in enumerate(every):
            apart = self._apart(task, task.poses)
            if apart.size and apart.max() > UNTOLD:
                worst = int(apart.max(axis=0).argmax())
                key = "task" if self.study.specification.task is not None else "test_pose"
                raise self.study.error(
                    key if len(every) == 1 or key == "task" else self.study.key_of(i),
                    f"depends on what no feasible pose tells: {self.shares.words[worst]}; free "
                    "joints that are fixed, or widen the workspace",
                )
        kept = self.model
        return every.with_columns(lambda task: self.setting.columns(task, kept))

    @cached_property
    def every_task(self) -> Tasks:
        """The same by all parameters that any poses could tell."""
        return self.study.tasks.with_columns(
            lambda task: self.setting.columns(task, self.structural)
        )

    def tells(self, task: Task, q: Array) -> bool:
        """Whether what feasible poses leave open does no harm in poses q (..., n) of a task.

        Args:
            task: One of `every_task`.
            q: The poses [rad or m].
        """
        return bool(self._apart(task, q).max(initial=0.0) <= UNTOLD)

    def _apart(self, task: Task, q: Array) -> Array:
        """Harm (rows, others) of what feasible poses leave open, less that of the rest [mm]."""
        rows = task.harm(q).reshape(-1, self.structural.p)
        others = self.shares
        return MM * np.abs(rows[:, others.left] - rows[:, others.kept] @ others.shares)

    @cached_property
    def as_drawn(self) -> tuple[str, ...]:
        """A sentence for each parameter that no pose tells, and that moves a tool in the tasks.

        Where markers sit is unknown, they tell neither the zero of the last joint nor its length.
        """
        model = self.setting.model
        told = _told(self.setting, model, *_anywhere(model, self.wrenches), self.before)
        moved = np.zeros(len(told.left), dtype=bool)
        for task in self.study.tasks:
            rows = self.setting.columns(task, self.setting.model)(task.q, bool(task.lever))
            apart = MM * np.abs(rows[:, told.left] - rows[:, told.kept] @ told.shares)
            moved |= apart.max(axis=0, initial=0.0) > UNTOLD
        return tuple(words for words, counts in zip(told.words, moved, strict=True) if counts)

    @property
    def target(self) -> Array | None:
        """The target A0 (r, p) of rho0 [m], see `Tasks.target`; None without test poses."""
        return self.tasks.target if self.tasks else None

    @property
    def targets(self) -> Array | None:
        """The same of each test pose (t, r, p), for the worst of them; zero without weight."""
        return self.tasks.targets if self.tasks else None

    def criterion(self, name: str | None = None) -> criteria.Criterion:
        """A criterion of the study's parameters, in their own units (mm, mrad, 1e-6 rad/(N m)).

        Args:
            name: Name of the criterion; defaults to the one that the study is about.

        Raises:
            UserError: There is no such criterion, it needs a test pose, or its parameters are
                wrong.
        """
        study = self.study
        name = study.main_criterion if name is None else name
        try:
            table = study.specification.criterion
            given: Any = given_parameters(name, table, self.space.parameters)
            found = criteria.create(name, self.target, targets=self.targets, **given)
            says_itself = found.needs_target or not found.takes_interest
            if study.specification.interest is None or says_itself:
                return found
            return criteria.Interest(found, *self.interest())
        except criteria.CriterionError as error:
            missing = isinstance(error, criteria.MissingTargetError)
            why = ", and the study has no [test_pose]" if missing else ""
            raise UserError(f"{error}{why}", where=study.where) from error

    def interest(self) -> tuple[Array, tuple[str, ...]]:
        """What is of interest: columns (p, s) of the identity, and the names (s,).

        The others are nuisance. Of parameters that cannot be told apart those count that the
        minimal set has.

        Raises:
            UserError: It has none of those that the study names.
        """
        table = self.study.specification.interest
        assert table is not None
        for name in table.parameters:
            if not any(name in one.groups for one in self.model.parameters):
                raise self.study.error(
                    "interest.parameters",
                    f"{name!r} cannot be told from other parameters; this study tells "
                    f"{', '.join(self.space.parameters)}",
                )
        chosen = [
            i
            for i, one in enumerate(self.model.parameters)
            if set(one.groups) & set(table.parameters)
        ]
        return np.eye(self.model.p)[:, chosen], tuple(self.space.parameters[i] for i in chosen)


def _space(base: DesignSpace, model: MeasuredModel, setting: StudyGeometry) -> GeometrySpace:
    """The space of a model, where the poses of another one may lie."""
    own = {one.name: getattr(base, one.name) for one in fields(base)}
    own |= {"sight": setting.sight, "noise": planned_noise(setting)}
    return GeometrySpace(**own, geometry=model, loads=setting.loads)


def _with(model: MeasuredModel, told: Identifiable) -> MeasuredModel:
    """The model with the parameters that are kept."""
    return model.with_parameters(tuple(model.parameters[i] for i in told.kept))


def _springs(model: MeasuredModel, told: Identifiable) -> tuple[str, ...]:
    """Sentences on the springs that no pose tells; much of the geometry is redundant anyway."""
    return tuple(
        words
        for i, words in zip(told.left, told.words, strict=True)
        if model.parameters[i].is_spring
    )


def _told(
    setting: StudyGeometry,
    model: MeasuredModel,
    q: Array,
    wrench: Array,
    before: PriorRows,
    sight: Sight | None = None,
) -> Identifiable:
    """What poses tell apart, as far as markers are seen, and what is known besides adds to that."""
    rows = PositionRows(model, setting.loads, sight=sight)(q, wrench).reshape(-1, model.p)
    return told_apart(model, rows, before)


def _before(setting: StudyGeometry, q: Array, wrench: Array) -> PriorRows:
    """What is known besides, in units of the parameters, with what poses cannot tell from it."""
    model = setting.model
    prior = design_prior(setting)
    if prior.earlier is not None:
        rows = PositionRows(model, setting.loads)(q, wrench).reshape(-1, model.p)
        prior = replace(prior, earlier=prior.earlier.completed(rows, model.scales))
    return PriorRows.of_gaussian(prior).scaled(model.scales)


def _telling(load: Load, wrenches: Array) -> Array:
    """Wrenches that tell all that the loads of visits do: of any force, one along each axis."""
    if not isinstance(load, FreeLoad):
        return wrenches
    return np.concatenate([wrenches, load.largest * np.eye(3, 6)])


def _anywhere(model: MeasuredModel, wrenches: Array) -> tuple[Array, Array]:
    """Poses within the joint limits, each under every load."""
    lower, upper = np.clip(model.robot.limits, -np.pi, np.pi)
    q = np.random.default_rng(0).uniform(lower, upper, (RANDOM_POSES, model.robot.n))
    return _under_each(q, wrenches)


def _feasible(space: GeometrySpace, study: Study, wrenches: Array) -> tuple[Array, Array]:
    """Feasible poses of the study, each under every load."""
    q = CandidateSource(space, 0, workers=1).take(RANDOM_POSES).x[:, : study.robot.n]
    return _under_each(q, wrenches)


def _under_each(q: Array, wrenches: Array) -> tuple[Array, Array]:
    """Every pose under every load."""
    return np.tile(q, (len(wrenches), 1)), np.repeat(wrenches, len(q), axis=0)


def geometry_setting(question: GeometryQuestion) -> dict[str, Any]:
    """Write robot, markers, parameters, loads, noise and test poses as plain data.

    Everything is in SI units and radians, but for the study's own keys, which name their units.

    Args:
        question: The question of the study.
    """
    # Weights and points are on the rigid chain: springs say where elastic joints are.
    bends = question.setting.loads is not None
    loads = StudyLoads.of(question.study) if bends else None
    model = question.model
    return {
        **feasible_to_dict(question.study, question.space),
        "unknown": [],
        "rows": question.model.rows,
        **_noise(question),
        "load": _load(question),
        "test_pose": [_test_pose(task) for task in question.study.tasks] or None,
        "physics": {
            "sensors": _sensors(question.model),
            "load_point": place_to_dict(
                BodyPoint() if loads is None else loads.by_wrench.load_point
            ),
            "weights": _weights(None if loads is None else loads.links),
        },
        "geometry": {
            "parameters": [_parameter(question, one) for one in question.model.parameters],
            "payload": _weights(None if loads is None else loads.payload),
            **({"changes": True} if bends and question.setting.reads_changes else {}),
            **({"places": list(model.places)} if model.is_distance.any() else {}),
        },
        **gives_to_dict(model.gives),
        **sight_to_dict(question.study, question.space.sight),
        **_interest(question),
        **({} if question.prior is None else {"prior": question.known.tolist()}),
    }


def _sensors(model: MeasuredModel) -> list[dict[str, Any]]:
    """The instruments: what each reads, and of which point."""
    assert model.anchors is not None
    every = zip(model.kinds, model.offsets, model.bodies, model.anchors, strict=True)
    return [
        {"kind": kind, "offset": offset.tolist(), "joint": joint}
        | ({"anchor": anchor.tolist()} if kind == "distance" else {})
        for kind, offset, joint, anchor in every
    ]


def _noise(question: GeometryQuestion) -> dict[str, Any]:
    """The white part, and the rest where there is any, of the rows that are read."""
    there = question.model.present.reshape(-1)
    noise = question.space.noise
    read = replace(noise, white=noise.white[there], discrepancy=noise.discrepancy[there])
    written = read.to_dict()
    return {"sigma": written["sigma"]} if noise.is_white and not noise.shares else written


def _load(question: GeometryQuestion) -> dict[str, Any]:
    """No load, the wrenches among which a visit chooses, or the largest force."""
    wrenches = question.wrenches
    if isinstance(question.space.load, FreeLoad):
        return {"F_max_N": question.space.load.largest}
    if len(wrenches) == 1:
        return {"F_N": [0.0, 0.0, 0.0], "T_Nm": [0.0, 0.0, 0.0]}
    return {"wrenches": wrenches.tolist()}


def _test_pose(task: Task) -> dict[str, Any]:
    """A task: what is as in a visit is left out."""
    sizes = {"within": task.within, "lever": task.lever}
    tool = {} if task.tool is None else {"tool": task.placed.tool.tolist()}
    own = {"weights": _weights(task.dead_weights)} if tool or task.carries else {}
    return {
        "q": task.q.tolist(),
        "wrench": task.wrench.tolist(),
        "weight": task.weight,
        **tool,
        **own,
        **{name: size for name, size in sizes.items() if size},
    }


def _weights(weights: DeadWeights | None) -> list[dict[str, Any]]:
    """Mass and centre of each weight; none without any."""
    return [] if weights is None else weights_to_list(weights)


def _parameter(question: GeometryQuestion, one: Parameter) -> dict[str, Any]:
    """A parameter: its name, what it moves, of which joint or marker, and its component."""
    robot = question.study.robot
    names = {
        "base": ("",),
        "joint": robot.body_names,
        "tool": question.model.markers,
        "compliance": robot.joint_names,
        "spring": robot.body_names,
        "compensator": compensator_names(robot),
    }
    found = {"name": one.name, "place": one.place, "of": names[one.place].index(one.of)}
    if one.place == "spring":
        ends = [COMPONENTS.index(end) if end else None for end in one.ends]
        return found | {"component": 0, "ends": ends, "law": one.law}
    if one.place == "compensator":
        return found | {"component": NUMBERS.index(one.component)}
    return found | {"component": COMPONENTS.index(one.component) if one.component else 0}


def _interest(question: GeometryQuestion) -> dict[str, Any]:
    """What criteria without a task are about; nothing where that is all."""
    if question.study.specification.interest is None:
        return {}
    return {"interest": question.interest()[0].tolist()}
