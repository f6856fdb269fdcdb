"""What a run asks about the designs of a study: where they lie, what they tell, and their worth."""

from dataclasses import dataclass

import criteria
from edtk.design.design_space import DesignSpace
from edtk.design.exact.exact_plan import ExactPlan
from edtk.design.exact.find_plan import SearchOptions, find_plan
from edtk.design.plan import Plan
from edtk.design.relaxation.relax_options import RelaxOptions
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.inference.least_squares import SingularPlanError
from edtk.model.expected_error import ExpectedError
from edtk.model.task_accuracy import TaskAccuracy
from edtk.study.accuracy_of_tasks import accuracy_of_tasks
from edtk.study.case import Case
from edtk.study.plan_accuracy import plan_accuracy
from edtk.study.plan_covariance import plan_covariance
from edtk.study.plan_plausibility import plan_plausibility
from edtk.study.planning_space import planning_space
from edtk.study.study import Study
from edtk.system.typing import Array

# Relative gap of the search over all poses: tables show efficiencies to 0.1 %.
TOLERANCE = 1e-4


@dataclass(frozen=True, eq=False)
class Designs:
    """The designs of a study of compliances; other kinds of study override what is theirs.

    Attributes:
        study: The study.
    """

    study: Study

    def space(self, size: int | None = None) -> DesignSpace:
        """Where plans of so many experiments are searched, with what is known besides."""
        return planning_space(self.study, size)

    def criterion(self, name: str | None = None) -> criteria.Criterion:
        """A criterion; by default the one that the study is about."""
        return self.study.criterion(name)

    def information(self, plan: Plan) -> Array:
        """Information matrix (p, p) of a plan, and of a prior that counts."""
        return self.study.information(plan)

    def relax_options(self) -> RelaxOptions:
        """How accurate relaxations over all poses are."""
        return RelaxOptions(tolerance=TOLERANCE)

    def distinct(self, sizes: range) -> range:
        """Numbers of distinct poses, of those below a size, for which plans are searched, too."""
        return sizes

    def search(self, relaxed: RelaxedPlan, case: Case, starts: int) -> ExactPlan:
        """The best plan of a case.

        Raises:
            NoPlanError: There is no such plan, as so few experiments tell too little.
        """
        options = SearchOptions(seed=self.study.specification.seed, starts=starts)
        return find_plan(relaxed, case.size, case.distinct, options=options)

    def expected(self, plan: Plan) -> ExpectedError | None:
        """Errors to expect in the test poses and around them; None where nothing tells them."""
        return plan_accuracy(self.study, plan)

    def accuracy(self, plan: Plan) -> TaskAccuracy | None:
        """Errors to expect in each of several test poses; None where nothing tells them."""
        try:
            cov = plan_covariance(self.study, self.information(plan))
            return accuracy_of_tasks(self.study, cov)
        except SingularPlanError:
            return None

    def warnings(self, plan: Plan) -> tuple[str, ...]:
        """What is hard to believe in what a plan promises, a line each."""
        return plan_plausibility(self.study, plan, self.expected(plan))
