"""A plan of visits for a study of geometry: how many it needs, what it tells, and its sheet.

The same question for given candidate poses is a `GeometryProblem`.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

import criteria
from edtk.calibration.geometry_question import GeometryQuestion
from edtk.calibration.geometry_space import PositionRows
from edtk.calibration.template import SheetColumns
from edtk.design.exact.day import DayPlan, PosesByLoad
from edtk.design.exact.day_search import DaySearch
from edtk.design.exact.exact_plan import (
    ExactPlan,
    NoPlanError,
    TooFewExperimentsError,
    require_enough,
)
from edtk.design.plan import Plan
from edtk.design.problem import Problem
from edtk.design.weighted_candidates import rows_of_blocks
from edtk.findings.causes.scene import Positions
from edtk.fit.fit_geometry import RANDOM_POSES, stages, told_apart
from edtk.fit.prior import PriorRows
from edtk.fit.sheet import VECTOR
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.noise import VisitNoise
from edtk.measure.parameters import Identifiable, Parameter, identifiable
from edtk.measure.pose_table import (
    CHANGE_COLUMN,
    DEFLECTION_COLUMNS,
    DISTANCE_COLUMN,
    LOADED_COLUMNS,
    MARKER_NAME_COLUMN,
    ROTATION_COLUMNS,
    pose_columns,
)
from edtk.measure.position_noise import PositionNoise
from edtk.study.study import Study
from edtk.study.study_geometry import StudyGeometry, StudyLoads, planned_noise
from edtk.system.errors import ArgumentError
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices, Mask


@dataclass(frozen=True, eq=False)
class ToldByPlan:
    """The parameters that a plan tells.

    Attributes:
        question: The question of the study.
        plan: The plan.
    """

    question: GeometryQuestion
    plan: Plan

    @cached_property
    def told(self) -> Identifiable:
        """Which parameters of the question it tells apart, with what is known besides."""
        question = self.question
        rows = question.rows(self.plan.q, self.plan.wrench).reshape(-1, question.model.p)
        known = PriorRows(question.known, np.zeros(len(question.known)))
        return told_apart(question.model, rows, known)

    @cached_property
    def covariance(self) -> Array:
        """Covariance (r, r) of these parameters, in their units."""
        return self.covariance_with(self.question.space.noise)

    def covariance_with(self, noise: VisitNoise) -> Array:
        """The same with other errors of the visits."""
        question = self.question
        kept = self.told.kept
        space = replace(question.space, noise=noise)
        rows = PositionRows(question.model, question.setting.loads, noise, space.sight)
        A = rows(self.plan.q, self.plan.wrench, space.visits_of(self.plan))
        weighted = np.sqrt(self.plan.repeats)[:, None, None] * A[..., kept]
        # From the rows: their squares would lose half of the digits.
        every = np.concatenate([weighted.reshape(-1, len(kept)), question.known[:, kept]])
        R = np.linalg.qr(every, mode="r")
        inverse = np.linalg.solve(R, np.eye(len(R)))
        return np.asarray(inverse @ inverse.T)


def visited(
    question: GeometryQuestion,
    q: Array,
    wrench: Array,
    time: Array,
    loads: StudyLoads | None = None,
) -> Positions:
    """Visits of a study of geometry at the drawing, in units of their noise.

    Args:
        question: The question of the study.
        q: Poses (m, n) [rad or m].
        wrench: Their loads (m, 6) [N, N m].
        time: When each is made (m,), see `since_first`.
        loads: What loads the joints; by default what does where springs are asked for.
    """
    setting, model, study = question.setting, question.model, question.study
    bending = setting.loads if loads is None else loads
    shared = question.space.visits_of(Plan(q, wrench, np.ones(len(q), dtype=int)))
    space = question.space
    as_taken = PositionRows(model, setting.loads, space.noise, space.sight)
    root = np.linalg.cholesky(as_taken.covariance(q, wrench, shared))

    def columns(parameters: tuple[Parameter, ...], wrench: Array) -> Array:
        own = replace(model, parameters=parameters)
        rows = PositionRows(own, bending, space.noise, space.sight)
        scales = np.array([one.scale for one in parameters])
        if question.space.noise.error is None:
            return rows(q, wrench, shared) / scales
        # Errors grow with the loads as they are taken, and not with those that are tried.
        plain = replace(rows, noise=None)(q, wrench) / scales
        return np.asarray(np.linalg.solve(root, plain))

    simulation = study.specification.simulation
    given = {} if simulation is None else simulation.compliance_rad_per_Nm
    soft = [given.get(name, 0.0) for name in study.specification.joints.unknown]
    joints = (*study.unknown, *study.known)  # known ones bend under another load, too
    return Positions(
        model.robot,
        tuple(name for name, own in zip(model.markers, model.on_tool, strict=True) if own),
        columns,
        columns(model.parameters, wrench),
        np.zeros(model.p),
        q,
        wrench,
        time,
        joints if setting.loads is not None else (),
        np.array([*soft, *study.known.values()]),
        bending,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class GeometryPlan(DayPlan):
    """The best plan of visits that a search has found.

    Attributes:
        question: The question of the study.
        rho0: Error to expect in the test poses [m]; None without any.
    """

    question: GeometryQuestion
    rho0: float | None = None

    @classmethod
    def answering(cls, question: GeometryQuestion, found: ExactPlan) -> Self:
        """A plan that was found, with its cost by rows, and with its error in the test poses."""
        whole = found.whole
        rho0 = None
        if question.target is not None:
            rho0 = question.cost(question.criterion("rho0"), whole)
        given = {name: getattr(found, name) for name in found.__dataclass_fields__}
        given |= {
            "cost": question.cost(found.relaxed.criterion, whole),
            "with_prior": question.prior is not None,
            "warnings": question.study.warnings,
        }
        return cls(**given, question=question, rho0=rho0)

    @property
    def poses(self) -> PosesByLoad:
        """The poses, each once, with its visits without and with each load; kept ones too."""
        return PosesByLoad.of(self.whole, self.question.wrenches, self.robot)

    @property
    def listed(self) -> Array:
        """The poses (k, n) in the order in which they are printed [rad or m]."""
        return self.poses.q

    @property
    def poses_kept(self) -> Indices:
        """How many of the visits of each of these poses were made already (k,)."""
        every = self.poses.visits.sum(axis=1)
        if self.kept is None:
            return np.zeros(len(every), dtype=int)
        return self.poses.visits_of(self.kept)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, as of other plans, with loads and what is identified."""
        poses = self.poses
        return {
            "costs": None,
            **super().to_dict(),
            "rank": self.question.model.p,
            "structural_rank": self.question.structural.p,
            "parameters": [one.name for one in self.question.model.parameters],
            "untold": list(self.question.untold),
            "rho0_mm": None if self.rho0 is None else 1e3 * self.rho0,
            "loads": poses.wrenches.tolist(),
            "poses": poses.to_list(),
        }


def require_enough_visits(question: GeometryQuestion, search: DaySearch, most: int) -> None:
    """Check that visits are enough to tell all parameters apart, before any search.

    Raises:
        TooFewExperimentsError: They are not enough.
    """
    model = question.model
    rows = most * model.row_count * len(model.markers)
    places = most if search.distinct is None or search.new is None else search.distinct
    if search.known is not None or not search.criterion.needs_all:
        return
    # Twice as many rows as parameters are enough, wherever markers are not in one place.
    if places < most or rows < 2 * model.p:
        require_enough(question.space, most, places, search.criterion)


def too_few_visits(
    question: GeometryQuestion, search: DaySearch, error: NoPlanError
) -> ArgumentError:
    """The error of visits that leave open what a criterion needs."""
    least = error.least if isinstance(error, TooFewExperimentsError) else None
    new, distinct, criterion = search.new, search.distinct, search.criterion
    if new is not None and distinct is not None and least is not None:
        return ArgumentError(str(error), argument="size" if new < least else "distinct")
    if new is None and distinct is not None:
        message = f"so few different visits cannot tell what {criterion.name} needs"
        return ArgumentError(message, argument="distinct", given=distinct)
    message = f"so few visits cannot tell what {criterion.name} needs; expected more"
    if criterion.needs_all:
        message = _all_parameters(question.model, least)
    if new is None:
        budget = None if search.costs is None else search.costs.budget
        return ArgumentError(message, argument="cost_budget", given=budget)
    count = 0 if search.kept is None else search.kept.experiments
    return ArgumentError(message, argument="size", given=new + count)


def _all_parameters(model: MeasuredModel, least: int | None) -> str:
    """How many visits tell all parameters apart."""
    count = len(model.markers)
    least = least or -(-model.p // (model.row_count * count))
    poses = "full poses of " if model.rows == "pose" else ""
    plural = "s" if count > 1 else ""
    return (
        f"so few visits cannot tell {model.p} parameters apart; expected {least} or more, "
        f"each of {poses}{count} marker{plural}"
    )


def position_columns(study: Study) -> SheetColumns:
    """The columns of the empty sheet of a study with [parameters], beside poses and loads.

    Reference points on the base have rows in every visit, too. Orientations of full poses are
    rotation vectors.
    """
    setting = StudyGeometry.of(study)
    names = (*setting.markers, *setting.references)
    empty = [*LOADED_COLUMNS, *(DISTANCE_COLUMN,) * bool(setting.distances)]
    if setting.full_poses:
        empty += _turn_columns(study, setting.turned)
    if setting.reads_changes:
        empty += DEFLECTION_COLUMNS + ROTATION_COLUMNS * setting.full_poses
        empty += (CHANGE_COLUMN,) * bool(setting.distances)

    def read(q: Array) -> Mask:
        assert setting.sight is not None
        always = np.ones((len(q), len(setting.references)), dtype=bool)
        return np.concatenate([setting.sight.seen(q), always], axis=1)

    seen = None if setting.sight is None else read
    return SheetColumns(len(names), {MARKER_NAME_COLUMN: names}, tuple(empty), seen, numbered=True)


def _turn_columns(study: Study, markers: tuple[str, ...]) -> list[str]:
    """Columns of the orientations; with the markers' names where a joint has one of them."""
    if set(VECTOR) & set(pose_columns(study.robot)):
        return [f"{name}_{column}" for name in markers for column in VECTOR]
    return list(VECTOR)


@dataclass(frozen=True, eq=False)
class GeometryProblem(Presented):
    """Candidates for a plan that tells geometry and springs.

    Attributes:
        problem: One candidate a pose and load; parameters are in their own units (mm, mrad,
            1e-6 rad/(N m)), and rows in those of the noise.
        q: Joint variables (n, joints) of the candidates [rad or m].
        wrench: Forces and torques (n, 6) of the candidates [N, N m].
        model: The minimal set of parameters, at the geometry of the drawing.
        noise: The noise of a reading.
        loads: What loads the joints; None without springs.
    """

    problem: Problem
    q: Array
    wrench: Array
    model: MeasuredModel
    noise: PositionNoise
    loads: StudyLoads | None

    def headline(self) -> str:
        """Number of candidates and of parameters."""
        return f"{self.problem.n} candidates, {self.problem.p} parameters of geometry and springs"

    def rows(self, q: ArrayLike, wrench: ArrayLike | None = None) -> Array:
        """How positions of all markers move with the parameters (m, 3k, p) [mm].

        Where the study measures full poses, each marker has three more rows: its orientation as a
        turn [mrad].

        Args:
            q: Poses (m, n) [rad or m].
            wrench: Forces and torques (m, 6) or (6,); none by default.
        """
        poses = np.atleast_2d(np.asarray(q, dtype=float))
        given = np.zeros(6) if wrench is None else np.asarray(wrench, dtype=float)
        wrenches = np.broadcast_to(given, (len(poses), 6))
        return PositionRows(self.model, self.loads)(poses, wrenches)

    def rho0(self, q: ArrayLike, wrench: ArrayLike | None = None) -> criteria.Criterion:
        """The position error to expect in tasks, where geometry and springs are compensated.

        It is the root mean square distance of the markers from where the calibrated model has them,
        over all tasks and markers, in millimetres: ``rho0^2 = trace(A0 M^-1 A0')`` with the rows A0
        of positions in the tasks over the square root of their number. No choice among parameters
        that cannot be told apart changes it.

        Args:
            q: Poses (t, n) of the tasks [rad or m].
            wrench: Their forces and torques (t, 6) or (6,); none by default.
        """
        rows = self.rows(q, wrench)[:, self.model.placed_rows]
        positions = rows.shape[0] * rows.shape[1] / 3
        A0 = rows.reshape(-1, rows.shape[-1]) / np.sqrt(positions)
        # As many rows as parameters say the same as all: only A0'A0 counts.
        found = criteria.create("rho0", np.linalg.qr(A0, mode="r") if len(A0) > A0.shape[1] else A0)
        found.shown = (1.0, "mm")  # its target is in millimetres already
        return found


def geometry_problem(
    study: Study,
    q: ArrayLike,
    wrench: ArrayLike | None = None,
    noise: PositionNoise | None = None,
) -> GeometryProblem:
    """Make the design problem of a study with [parameters].

    A loaded and an unloaded visit of a pose are different candidates: list the pose twice. The
    minimal set of parameters is that which any poses could tell under the loads listed. Rows are
    those at the geometry of the drawing; markers are where the study says (`position_mm`).

    Args:
        study: The study.
        q: Poses (n, joints) of the candidates [rad or m].
        wrench: Forces and torques (n, 6) or (6,) [N, N m]; none by default.
        noise: Errors of a pose; the stated ones by default, with what the model leaves out. The
            tracker of those of a fit stands where the study has it.

    Raises:
        UserError: The study has no [parameters].
        ValueError: Arrays do not fit the robot.
    """
    study.kind.parameters(study)
    setting = StudyGeometry.of(study)
    poses = np.asarray(q, dtype=float)
    if poses.ndim != 2 or poses.shape[1] != study.robot.n or not len(poses):
        raise ValueError(f"poses have the shape {poses.shape}, expected (n, {study.robot.n})")
    wrenches = np.zeros(6) if wrench is None else np.asarray(wrench, dtype=float)
    forces = np.broadcast_to(wrenches, (len(poses), 6))
    loads = setting.loads
    model = _minimal(setting.model, poses, forces, loads)
    reading = setting.noise if noise is None else noise.with_place_of(setting.noise)
    if reading.rows != model.row_count:
        asked = "a size for orientations" if setting.full_poses else "none for orientations"
        raise ValueError(f"noise.turn is {reading.turn}; expected {asked}")
    markers = len(model.markers)
    given = reading.of_visits(model.row_count * markers, markers)
    errors = planned_noise(setting) if noise is None else given
    blocks = PositionRows(model, loads, errors, setting.sight)(poses, forces)
    names = tuple(one.name for one in model.parameters)
    problem = Problem.of_kept(rows_of_blocks(blocks, 1.0), names, None)
    return GeometryProblem(problem, poses, forces, model, reading, loads)


def _minimal(
    model: MeasuredModel, q: Array, wrench: Array, loads: StudyLoads | None
) -> MeasuredModel:
    """The model with the parameters that any poses could tell under these loads."""
    rng = np.random.default_rng(0)
    lower, upper = np.clip(model.robot.limits, -np.pi, np.pi)
    drawn = rng.uniform(lower, upper, (RANDOM_POSES, model.robot.n))
    some = rng.integers(0, len(q), RANDOM_POSES)
    few = np.unique(some)
    poses = np.concatenate([drawn, q[few]])
    forces = np.concatenate([wrench[some], wrench[few]])
    rows = PositionRows(model, loads)(poses, forces).reshape(-1, model.p)
    kept = identifiable(rows, model.parameters, stages(model)).kept
    return model.with_parameters(tuple(model.parameters[i] for i in kept))
