"""The worth of a plan of visits, and what a run asks about designs of geometry."""

from dataclasses import dataclass, replace
from functools import cached_property, partial
from time import monotonic
from typing import Any, ClassVar, Self

import numpy as np
from scipy.linalg import block_diag

import criteria
from criteria.linalg.inverse import root
from edtk.calibration.geometry_plan import (
    GeometryPlan,
    ToldByPlan,
    require_enough_visits,
    too_few_visits,
    visited,
)
from edtk.calibration.geometry_question import UNTOLD, GeometryQuestion
from edtk.calibration.geometry_space import GeometrySpace, PositionRows
from edtk.calibration.planned import CalibratedDesigns
from edtk.calibration.propagation import OfVisits, Propagation, uncertainty_of
from edtk.calibration.told_part import LeastSquaresInverse
from edtk.calibration.visit_propagation import Visits, propagated, untold_joints
from edtk.design.exact.day import MOST_VISITS, DayCosts, PosesByLoad
from edtk.design.exact.day_search import DaySearch
from edtk.design.exact.exact_plan import ExactPlan, NoPlanError, require_enough
from edtk.design.exact.visit_search import VISIT_STARTS, VisitSearch
from edtk.design.plan import Plan
from edtk.design.relaxation.relax_poses import RelaxOptions
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.findings.causes.scene import Positions
from edtk.findings.finding import Finding, Severity, Wording
from edtk.fit.distributions import task_accuracy
from edtk.fit.prior import PriorRows
from edtk.measure.expected_error import (
    WITHIN,
    ExpectedError,
    TaskAccuracy,
)
from edtk.measure.friction import Friction
from edtk.measure.noise import VisitNoise
from edtk.measure.parameters import Identifiable, all_parameters
from edtk.measure.task import Columns, Task, Tasks
from edtk.robots.frames import MM
from edtk.robots.workspace import neighbourhood
from edtk.study.evaluate import Evaluation, observability
from edtk.study.plan_study import RunOptions, study_errors
from edtk.study.plausibility import poor_around
from edtk.study.study import Study
from edtk.study.study_geometry import StudyLoads
from edtk.study.study_model import springs_of
from edtk.study.study_objects import friction_of
from edtk.study.study_run import Case
from edtk.system.errors import ArgumentError
from edtk.system.time_limit import no_progress
from edtk.system.typing import Array

USUAL = 1.0  # mm and mrad: errors of a drawing that are larger are the exception
HIDDEN = 1e-9  # of a direction: a visit alone tells it
# Relative gap at which the search over all poses ends. Designs of 35 parameters rest on a hundred
# poses and more, whose last digits would take minutes.
TOLERANCE = 1e-3
OF_PLANS = 2e-2  # that of the bound of a plan: one of more parameters than a few would take minutes
FEW = 12
SEARCHES = 12  # over all poses for the bound, at most: what is left after them is a per cent or two


def poor_left_out(question: GeometryQuestion, plan: Plan) -> tuple[Finding, ...]:
    """A sentence where a pose left out will likely be worse than with base and tool alone.

    With whitened columns ``Q R`` and the rows Q_b of a visit, its error left out has the covariance
    ``(I - Q_b Q_b')^-1``; with base and tool alone it is that of the noise, beside the errors of
    the drawing that these do not take up. Both are averages over the visits of the plan, of
    positions. Where the drawing has to err by more than a millimetre and a milliradian in each
    parameter for the calibration to pay, it likely does not.

    Args:
        question: The question; its study says what the model leaves out (noise.discrepancy_mm).
        plan: The visits; those of one pose and load count as one.
    """
    table = question.study.specification.noise
    if table is None or not table.discrepancy_mm:
        return ()
    model = question.model
    errors = np.array([one.place in ("joint", "compliance") for one in model.parameters])
    if not errors.any():
        return ()
    # What repeats do not average out is most of such an error.
    of_positions = PositionRows(model, question.setting.loads, sight=question.space.sight)
    points = np.moveaxis(of_positions.columns.at(plan.q).points, -1, 0)
    sigma = float(np.hypot(question.setting.noise.typical(points), table.discrepancy_mm))
    rows = of_positions(plan.q, plan.wrench)
    rows = rows[:, model.placed_rows] / sigma
    both = _left_out(rows, question.known)
    alone = _left_out(rows[..., ~errors], question.known[:, ~errors])
    moved = _not_taken(rows[..., errors], rows[..., ~errors])
    if both <= alone:
        return ()
    needed = np.sqrt((both - alone) / moved)
    if needed < USUAL:
        return ()
    off, placed = (sigma * float(np.sqrt(3 * size)) for size in (both, alone))
    data = {"discrepancy_mm": table.discrepancy_mm, "off_mm": off, "placed_mm": placed}
    return (Finding.of(Severity.WARNING, WORDING, "poor_left_out", needed=float(needed), **data),)


WORDING: Wording = {
    "poor_left_out": lambda data: (
        f"a pose that is not visited will be about {data['off_mm']:.2g} mm off, by the noise and "
        f"what the model leaves out (noise.discrepancy_mm = {data['discrepancy_mm']:g}); base and "
        f"tool alone leave {data['placed_mm']:.2g} mm and the errors of the drawing. So few visits "
        f"pay only where these are above {data['needed']:.2g} mm and mrad each: plan more visits, "
        "or ask for fewer parameters"
    ),
}


def _left_out(rows: Array, known: Array) -> float:
    """Mean square of a whitened coordinate (m, r) that is predicted without its visit.

    Args:
        rows: How coordinates move with the parameters (m, r, p).
        known: Rows (c, p) of what is known besides.
    """
    m, r, p = rows.shape
    Q = np.linalg.qr(np.concatenate([rows.reshape(m * r, p), known]))[0]
    Q = Q[: m * r].reshape(m, r, -1)
    hidden = np.eye(r) - Q @ np.swapaxes(Q, 1, 2)
    inverse = np.linalg.pinv(hidden, rcond=HIDDEN, hermitian=True)
    return float(np.einsum("mrr->", inverse)) / (m * r)


def _not_taken(moves: Array, taken: Array) -> float:
    """Mean square of a whitened coordinate by unit errors (m, r, e), less what others take up."""
    m, r, _ = moves.shape
    Q = np.linalg.qr(taken.reshape(m * r, -1))[0]
    C = moves.reshape(m * r, -1)
    return float(((C - Q @ (Q.T @ C)) ** 2).sum()) / (m * r)


@dataclass(frozen=True, eq=False, kw_only=True)
class GeometryEvaluation(Evaluation):
    """What a plan tells, and how well; parameters in their own units (mm, mrad, 1e-6 rad/(N m)).

    Criteria have no value where parameters are open, and the covariance is of those that are told.

    Attributes:
        question: The question of the study.
        poses: The poses with their visits by load.
        parameters: The parameters (r,) that the plan tells.
        open: A sentence for each parameter that feasible poses could tell, and this plan does not.
        rho0: Error to expect in the test poses [m]; None without any, or where it depends on an
            open parameter.
    """

    question: GeometryQuestion
    poses: PosesByLoad
    open: tuple[str, ...]
    rho0: float | None

    def headline(self) -> str:
        """Number of visits, and how many parameters they tell."""
        rho0 = "" if self.rho0 is None else f", rho0 {1e3 * self.rho0:.4g} mm"
        return (
            f"{self.experiments} visits tell {self.rank} of {self.question.model.p} parameters "
            f"apart{rho0}"
        )

    @property
    def rank(self) -> int:
        """Number of parameters that the plan tells apart."""
        return len(self.parameters)

    @property
    def names(self) -> tuple[str, ...]:
        """Names (r,) of these parameters."""
        return tuple(one.name for one in self.parameters)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON."""
        return {
            **super().to_dict(),
            "units": list(self.units),
            "rank": self.rank,
            "possible_rank": self.question.model.p,
            "structural_rank": self.question.structural.p,
            "open": list(self.open),
            "untold": list(self.question.untold),
            "rho0_mm": None if self.rho0 is None else 1e3 * self.rho0,
            "loads": self.poses.wrenches.tolist(),
            "poses": self.poses.to_list(),
        }


def visit_propagation(question: GeometryQuestion, plan: Plan) -> Propagation | None:
    """Propagate the circumstances of a calibration by visits to what it estimates.

    All is to the first order about the drawing, with the compliances of [simulation].

    Args:
        question: The question of the study.
        plan: All visits.

    Returns:
        The errors, see `propagated`; None where springs are unknown and there is no [simulation],
        or if the plan leaves a parameter open.
    """
    study, setting, model = question.study, question.setting, question.model
    by_plan = ToldByPlan(question, plan)
    if len(by_plan.told.left) or (study.unknown and study.specification.simulation is None):
        return None
    visits = np.repeat(np.arange(len(plan.q)), plan.repeats)
    q, wrench = plan.q[visits], plan.wrench[visits]

    def under(loads: StudyLoads) -> Positions:
        return visited(question, q, wrench, np.zeros(len(q)), loads)

    A = under(setting.every_load)
    names = tuple(one.name for one in model.parameters)
    known = question.known / model.scales
    prior = PriorRows(known, np.zeros(len(known))) if len(known) else None
    units = np.outer(model.scales, model.scales)
    noise = question.promised.space.noise
    by_noise, by_both = map(by_plan.covariance_with, (noise.exact, noise))
    soft = {study.robot.joint_names[j]: k for j, k in zip(A.sprung, A.soft.tolist(), strict=True)}
    k = [soft.get(one.of, 0.0) if one.place == "compliance" else 0.0 for one in model.parameters]
    table = study.specification.noise
    return propagated(
        Visits(
            setting=setting,
            model=model,
            under=under,
            inverse=LeastSquaresInverse.of_rows(A.A, np.ones(A.A.shape[:2]), names, prior),
            taken=np.array(k),
        ),
        uncertainty_of(study, None, untold_joints(setting, model.parameters)),
        {"noise": by_noise * units, "model": (by_both - by_noise) * units},
        OfVisits(setting, model, 0.0 if table is None else table.discrepancy_mm / 1e3),
    )


@dataclass(frozen=True, eq=False)
class GeometryDesigns(CalibratedDesigns):
    """The designs of a study of geometry: visits of poses, without and with a load.

    Without a budget all loads are there to choose from, and the size alone decides; with one, see
    `DaySearch`.

    Attributes:
        question: The question of the study.
    """

    question: GeometryQuestion
    of_visits: ClassVar[bool] = True
    unit: ClassVar[str] = "own units"  # of the parameters: mm, mrad, 1e-6 rad/(N m)
    what: ClassVar[str] = "visits"
    most: ClassVar[int | None] = MOST_VISITS
    tolerance: ClassVar[float] = TOLERANCE

    @classmethod
    def of(cls, study: Study) -> Self:
        """Those of a study with [parameters].

        Raises:
            UserError: Its loads are none that a plan can choose among, or no pose is feasible.
        """
        with study_errors(study):
            return cls(study, GeometryQuestion.of(study))

    def designed(self, name: str | None = None) -> Study:
        """The study itself."""
        return self.study

    def base(self, name: str | None = None) -> GeometrySpace:
        """Where visits may lie, with nothing that is known besides."""
        return self.question.space

    def space(self, size: int | None = None, name: str | None = None) -> GeometrySpace:
        """The same of plans of so many visits, with what is known besides."""
        return self.question.space_for(size or self.study.specification.sizes[0])

    def criterion(self, name: str | None = None) -> criteria.Criterion:
        """A criterion of the parameters in their own units."""
        return self.question.criterion(name)

    def information(self, plan: Plan, name: str | None = None) -> Array:
        """Information matrix (p, p) of a plan, and of what is known besides."""
        return self.question.information(plan)

    def cost(self, plan: Plan, name: str | None = None) -> float:
        """A criterion's cost of a plan, and of what is known besides, by the plan's rows."""
        return self.question.cost(self.criterion(name), plan)

    def has_prior(self, name: str | None = None) -> bool:
        """Whether something that is known besides counts."""
        return self.question.prior is not None

    def known_beside(self, kept: Plan | None, name: str | None = None) -> Array | None:
        """Information (p, p) of what is known besides, and of kept visits."""
        return self.question.prior if kept is None else self.question.information(kept)

    def wrenches(self, costs: DayCosts | None) -> Array | None:
        """The loads (s, 6) to choose from; None where each visit has a force of its own."""
        return None if self.question.chooses_forces else self.question.wrenches

    def ways(self, kept: Plan | None, options: RunOptions) -> dict[str, Any]:
        """How a `DaySearch` relaxes, and searches from a relaxation."""
        relax = RelaxOptions(tolerance=OF_PLANS, workers=options.workers)
        return {"relax": relax, "searches": SEARCHES, "workers": options.workers}

    def require_enough(self, search: DaySearch, most: int) -> None:
        """Check that so many visits are enough, before any search."""
        require_enough_visits(self.question, search, most)

    def too_few(self, search: DaySearch, error: NoPlanError) -> ArgumentError:
        """The error of visits that leave open what a criterion needs."""
        return too_few_visits(self.question, search, error)

    def finished(self, found: ExactPlan) -> GeometryPlan:
        """A plan that was found, with what it tells."""
        return GeometryPlan.answering(self.question, found)

    def relax_options(self) -> RelaxOptions:
        """How accurate relaxations over all poses are: the same on every machine."""
        searches = 0

        def progress(stage: str, gap: float) -> None:
            nonlocal searches
            searches += stage == "continuum"

        tolerance = TOLERANCE if self.question.model.p <= FEW else OF_PLANS
        return RelaxOptions(
            tolerance=tolerance, progress=progress, stop=lambda plan: searches >= SEARCHES
        )

    def of_size(self, relaxed: RelaxedPlan, case: Case, starts: int) -> ExactPlan:
        """The best plan of a case, whatever it costs.

        Raises:
            NoPlanError: So few visits tell too little.
        """
        since = monotonic()
        space = self.space(case.size)
        criterion = relaxed.criterion
        places = case.size if case.distinct is None else case.distinct
        if criterion.needs_all and not self.has_prior():
            require_enough(space, case.size, places, criterion)
        seed = self.study.specification.seed
        search = VisitSearch(
            space, relaxed, criterion, seed, no_progress, starts=min(starts, VISIT_STARTS)
        )
        found = search.of_size(case.size, case.distinct)
        best = ExactPlan.of(relaxed, found)
        cost = self.question.cost(criterion, best.plan)
        if not np.isfinite(cost):
            raise NoPlanError(f"so few visits cannot tell what {criterion.label} needs")
        return replace(best, cost=cost, seconds=monotonic() - since)

    def in_each_task(self, cov: Array) -> TaskAccuracy:
        """Errors in each of several test poses, of parameters with a covariance (p, p)."""
        return task_accuracy(self.tasks, cov, is_path=self.study.specification.task is not None)

    @property
    def noise(self) -> VisitNoise:
        """The noise of visits."""
        return self.question.space.noise

    def by_springs(self, tasks: Tasks) -> float:
        """By the springs of all joints."""
        error = self.question.promised.space.noise.error
        if error is None:
            return 0.0
        setting = self.question.setting
        robot = self.study.robot
        every = all_parameters(robot, (), (), robot.joint_names, base=False, tool=False)
        model = setting.model.with_parameters(every)

        def columns(task: Task) -> Columns:
            own = setting.columns(task, model, setting.every_load_of(task))
            return lambda q, turned: own(q, turned) / model.scales

        return replace(error, k=error.k / MM).remaining(tasks.with_columns(columns).target)

    def with_friction(self, tasks: Tasks, plan: Plan) -> tuple[Array, Array] | None:
        """All parameters with shares.

        A study that asks for dead zones of springs, which hold loads as friction does, has them
        there.
        """
        question, model = self.question.promised, self.question.model
        error, loads = question.space.noise.error, question.setting.loads
        friction = None if error is None else friction_of(self.study, error.share, loads)
        if friction is None or any(one.law == "gap" for one in model.parameters):
            return None
        visits = np.repeat(np.arange(len(plan.q)), plan.repeats)
        q, wrench = plan.q[visits], plan.wrench[visits]
        scene = visited(question, q, wrench, np.zeros(len(q)))
        own = slice(len(friction))  # known springs come after the unknown ones
        factors = friction.factors(scene.torque.T[own])
        held = scene.springs[..., own] * factors.T[:, None]
        rows = np.concatenate([scene.A, held], axis=-1).reshape(-1, model.p + len(friction))
        known = block_diag(question.known / model.scales, root(friction.information))
        target = tasks.with_columns(partial(self._held_in, friction)).target
        return np.concatenate([rows, known]), target

    def _held_in(self, friction: Friction, task: Task) -> Columns:
        """How a task moves with the parameters, and with shares of loads that friction holds."""
        setting, model = self.question.setting, self.question.model
        springs = model.with_parameters(springs_of(self.study))
        loads = setting.every_load_of(task)
        own, elastic = (setting.columns(task, one, loads) for one in (model, springs))

        def columns(q: Array, turned: bool) -> Array:
            torque = loads(np.atleast_2d(q), np.tile(task.wrench, (len(np.atleast_2d(q)), 1)))
            factors = friction.factors(torque[:, list(self.study.unknown)].T).T
            held = elastic(q, turned) * factors.reshape(*q.shape[:-1], 1, -1)
            both = [own(q, turned) / model.scales, held / springs.scales]
            return np.concatenate(both, axis=-1)

        return columns

    def propagated(self, plan: Plan) -> Propagation | None:
        """What is uncertain; None if any is open, or springs are without a [simulation]."""
        return visit_propagation(self.question, plan)

    @property
    def tasks(self) -> Tasks:
        """The study's tasks, in which errors of the parameters of a plan do harm."""
        return self.question.tasks

    def warnings(
        self,
        plan: Plan,
        expected: ExpectedError | None,
        criterion: criteria.Criterion | None = None,
    ) -> tuple[Finding, ...]:
        """Whether a plan is poor around the test poses, beside base and tool, or assumes much."""
        found = (*poor_left_out(self.question, plan), *self.rests_on_known(plan))
        asked = criterion or criteria.get(self.study.main_criterion)
        if expected is None or not asked.needs_target:
            return found
        return (*found, *poor_around(expected))

    def evaluate(self, plan: Plan) -> GeometryEvaluation:
        """Score a plan of visits under every criterion that the study can evaluate.

        A plan that leaves parameters open is scored, too: the standard deviations are then those of
        the parameters that it tells, criteria of all parameters have no value, and rho0 has one
        where no open parameter moves a marker in the test poses.

        Args:
            plan: The plan, whether or not its poses are feasible.

        Raises:
            UserError: A criterion that the study names fails.
        """
        question = self.question
        by_plan = ToldByPlan(question, plan)
        told = by_plan.told
        parameters = tuple(question.model.parameters[i] for i in told.kept)
        return GeometryEvaluation(
            **self.judged(plan, is_whole=not len(told.left)),
            question=question,
            poses=PosesByLoad.of(plan, question.wrenches, self.study.robot),
            covariance=by_plan.covariance,
            parameters=parameters,
            units=tuple(one.unit for one in parameters),
            open=told.words,
            rho0=_rho0(question, told, by_plan.covariance),
        )

    @property
    def counts_prior(self) -> bool:
        """Whether something that is known besides counts."""
        return self.question.prior is not None

    def unscaled(self, plan: Plan) -> dict[str, float]:
        """O1 to O5 of the stacked regressor in mm and mrad, without division by the noise."""
        rows = self.question.rows(plan.q, plan.wrench)
        return observability(rows, plan.repeats, self.question.criterion)

    @cached_property
    def is_told(self) -> bool:
        """Whether feasible poses tell all that moves the markers around the test poses."""
        question = self.question
        return all(
            question.tells(task, neighbourhood(task.robot, task.q, task.within or WITHIN))
            for task in question.every_task
        )

    def covariance(self, plan: Plan) -> Array | None:
        """Covariance (p, p) of the parameters; None where the plan leaves any open."""
        by_plan = ToldByPlan(self.question, plan)
        return None if len(by_plan.told.left) else by_plan.covariance


def _rho0(question: GeometryQuestion, told: Identifiable, cov: Array) -> float | None:
    """The error in the test poses [m]; None without any, or where it depends on what is open."""
    target = question.target
    if target is None:
        return None
    apart = target[:, told.left] - target[:, told.kept] @ told.shares
    if MM * np.abs(apart).max(initial=0.0) > UNTOLD:
        return None
    rows = target[:, told.kept]
    return float(np.sqrt(np.einsum("rp,pq,rq->", rows, cov, rows)))
