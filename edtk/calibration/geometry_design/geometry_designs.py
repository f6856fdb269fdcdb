"""What a run asks about the designs of a study of geometry."""

from dataclasses import dataclass
from functools import cached_property
from time import monotonic

import numpy as np

import criteria
from edtk.calibration.geometry_design.day_search import SEARCHES
from edtk.calibration.geometry_design.day_search import TOLERANCE as OF_PLANS
from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.calibration.geometry_design.geometry_space import GeometrySpace
from edtk.calibration.geometry_design.marker_task import MarkerTask, marker_tasks
from edtk.calibration.geometry_design.plan_geometry import plan_geometry
from edtk.calibration.geometry_design.poor_left_out import poor_left_out
from edtk.calibration.geometry_design.told_by_plan import ToldByPlan
from edtk.calibration.geometry_design.visit_search import STARTS, VisitSearch
from edtk.design.exact.exact_plan import ExactPlan
from edtk.design.exact.no_plan_error import NoPlanError
from edtk.design.exact.require_enough import require_enough
from edtk.design.plan import Plan
from edtk.design.relaxation.relax_options import RelaxOptions
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.inference.task_accuracy import task_accuracy
from edtk.model.expected_error import WITHIN, ExpectedError, expected_error
from edtk.model.neighbourhood import neighbourhood
from edtk.model.task_accuracy import TaskAccuracy
from edtk.model.tasks import Tasks
from edtk.study.case import Case
from edtk.study.designs import Designs
from edtk.study.poor_around import poor_around
from edtk.study.run_options import no_progress
from edtk.study.study import Study
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array

# Relative gap at which the search over all poses ends. With more parameters than a few it is that
# of `plan_geometry`, as are the most searches: what is left would take minutes.
TOLERANCE = 1e-3
FEW = 12


@dataclass(frozen=True, eq=False)
class GeometryDesigns(Designs):
    """The designs of a study of geometry: visits of poses, without and with a load.

    Attributes:
        question: The question of the study.
    """

    question: GeometryQuestion

    @classmethod
    def of(cls, study: Study) -> "GeometryDesigns":
        """Those of a study with [parameters].

        Raises:
            UserError: Its loads are none that a plan can choose among, or no pose is feasible.
        """
        return cls(study, GeometryQuestion.of(study))

    def space(self, size: int | None = None) -> GeometrySpace:
        """Where visits may lie; nothing is known besides."""
        return self.question.space

    def criterion(self, name: str | None = None) -> criteria.Criterion:
        """A criterion of the parameters in their own units."""
        return self.question.criterion(name)

    def information(self, plan: Plan) -> Array:
        """Information matrix (p, p) of a plan."""
        return self.question.space.information(plan)

    def relax_options(self) -> RelaxOptions:
        """How accurate relaxations over all poses are: the same on every machine."""
        searches = 0

        def progress(stage: str, gap: float) -> None:
            nonlocal searches
            searches += stage == "continuum"

        tolerance = TOLERANCE if self.question.model.p <= FEW else OF_PLANS
        return RelaxOptions(
            tolerance=tolerance, progress=progress, stop=lambda: searches >= SEARCHES
        )

    @property
    def has_budget(self) -> bool:
        """Whether the study says what a day may cost."""
        costs = self.study.specification.costs
        return costs is not None and costs.budget is not None

    def distinct(self, sizes: range) -> range:
        """Numbers of distinct visits for which plans are searched; none within a budget."""
        return range(0) if self.has_budget else sizes

    def search(self, relaxed: RelaxedPlan, case: Case, starts: int) -> ExactPlan:
        """The best plan of a case, within the study's budget if it has one.

        Raises:
            NoPlanError: So few visits tell too little, or a budget does not pay for them.
        """
        if self.has_budget:
            return self._within_budget(relaxed, case)
        since = monotonic()
        space = self.question.space
        criterion = relaxed.criterion
        places = case.size if case.distinct is None else case.distinct
        if criterion.needs_all:
            require_enough(space, case.size, places, criterion)
        seed = self.study.specification.seed
        search = VisitSearch(
            space, relaxed, criterion, seed, no_progress, starts=min(starts, STARTS)
        )
        found = search.of_size(case.size, case.distinct)
        plan = space.plan(found.x, found.repeats)
        cost = float(criterion.cost(space.information(plan)))
        if not np.isfinite(cost):
            raise NoPlanError(f"so few visits cannot tell what {criterion.label} needs")
        return ExactPlan(
            relaxed,
            plan,
            None,
            cost,
            found.starts,
            found.found,
            found.optima,
            monotonic() - since,
            found.ended,
        )

    def _within_budget(self, relaxed: RelaxedPlan, case: Case) -> ExactPlan:
        """The same, where a day pays for some loads alone."""
        costs = self.study.specification.costs
        budget = None if costs is None else costs.budget
        try:
            # Given here, a budget that pays for too little is an error of this call.
            found = plan_geometry(self.study, case.size, case.optimised, cost_budget=budget)
        except ArgumentError as error:
            raise NoPlanError(error.message) from error
        return ExactPlan(
            relaxed,
            found.plan,
            None,
            found.cost,
            found.starts,
            found.found,
            found.optima,
            found.seconds,
            found.ended,
        )

    @cached_property
    def tasks(self) -> Tasks:
        """The test poses; there may be none."""
        return marker_tasks(self.question)

    def expected(self, plan: Plan) -> ExpectedError | None:
        """Errors of the markers to expect in the test poses and around them.

        Returns:
            The errors; None without test poses, where the plan leaves a parameter open, or where
            something that no feasible pose tells moves the markers around a test pose.
        """
        cov = self._covariance(plan)
        if not self.tasks or cov is None or not self._is_told:
            return None
        return expected_error(self.tasks, cov)

    def accuracy(self, plan: Plan) -> TaskAccuracy | None:
        """Errors of the markers to expect in each of several test poses; None likewise."""
        cov = self._covariance(plan)
        if len(self.tasks) < 2 or cov is None:
            return None
        return task_accuracy(self.tasks, cov)

    def warnings(self, plan: Plan) -> tuple[str, ...]:
        """Whether a plan is poor around the test poses, or no better than base and tool alone."""
        few = poor_left_out(self.question, plan)
        if not criteria.get(self.study.main_criterion).needs_target:
            return few
        return (*few, *self.around(plan))

    def around(self, plan: Plan) -> tuple[str, ...]:
        """The same of a plan for any criterion; nothing where nothing tells these errors."""
        expected = self.expected(plan)
        return () if expected is None else poor_around(expected)

    @cached_property
    def _is_told(self) -> bool:
        """Whether feasible poses tell all that moves the markers around the test poses."""
        return all(
            isinstance(task, MarkerTask)
            and task.is_told(neighbourhood(task.robot, task.q, task.within or WITHIN))
            for task in self.tasks
        )

    def _covariance(self, plan: Plan) -> Array | None:
        """Covariance (p, p) of the parameters; None where the plan leaves any open."""
        by_plan = ToldByPlan(self.question, plan)
        return None if len(by_plan.told.left) else by_plan.covariance
