"""The result of a whole study."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from edtk.design.bound import Bound
from edtk.design.plan import Plan
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.model.expected_error import ExpectedError
from edtk.model.task_accuracy import TaskAccuracy
from edtk.study.bound_for import bound_for
from edtk.study.case import Case
from edtk.study.designs import Designs
from edtk.study.study import Study
from edtk.system.presented import Presented

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class StudyRun(Presented):
    """All plans of a study, compared under all its criteria.

    Attributes:
        study: The study.
        table: One row a plan, as in `results.csv`, see `comparison_table`.
        relaxations: The relaxation of every criterion that can be relaxed, by `relaxation_key`.
        cases: The plans in the order of the table, with how they were found.
        folder: Folder that holds the files of the run.
        own_designs: The designs of the study; None for those of compliances alone.
    """

    study: Study
    table: "pd.DataFrame"
    relaxations: Mapping[str, RelaxedPlan]
    cases: tuple[Case, ...]
    folder: Path
    own_designs: Designs | None = None

    @property
    def designs(self) -> Designs:
        """What the designs of the study are."""
        return Designs(self.study) if self.own_designs is None else self.own_designs

    def headline(self) -> str:
        """Title, number of plans, and the efficiency of the largest plan for the main criterion."""
        name = self.study.main_criterion
        text = f"{self.study.specification.title}, {len(self.plans)} plans"
        searched = [case.found for case in self.cases if case.optimised == name and case.found]
        if not searched:
            return text
        best = max(searched, key=lambda found: found.whole.experiments)
        return f"{text}; {best.headline()}"

    def bound(self, size: int) -> Bound | None:
        """The bound on the main criterion of plans of so many experiments; None without one."""
        return bound_for(self.relaxations, self.study.main_criterion, size)

    @property
    def expected(self) -> ExpectedError | None:
        """Errors to expect of the largest plan for the main criterion; None without a test pose."""
        return None if self.best is None else self.designs.expected(self.best)

    @cached_property
    def accuracies(self) -> dict[str, TaskAccuracy]:
        """Errors to expect in each of several test poses, by the name of the plan.

        The largest plan for the main criterion comes first, then others of as many experiments. It
        is empty for a single test pose or none.
        """
        if self.best is None or len(self.study.tasks) < 2:
            return {}
        size = self.best.experiments
        main = self.study.main_criterion
        alike = [case for case in self.cases if case.size == size and case.kind != "distinct"]
        found = {_plan_name(case): self._accuracy(case.plan) for case in alike}
        first = f"optimised for {main}"
        order = (first, *(name for name in found if name != first))
        return {name: one for name in order if (one := found[name]) is not None}

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """What is hard to believe in the study or in that plan, a line each."""
        of_plan = () if self.best is None else self.designs.warnings(self.best)
        return self.study.warnings + of_plan

    def _accuracy(self, plan: Plan | None) -> TaskAccuracy | None:
        """What a plan promises in each test pose; None if it leaves a parameter open."""
        return None if plan is None else self.designs.accuracy(plan)

    @property
    def best(self) -> Plan | None:
        """The largest plan for the main criterion; None where there is none."""
        of_main = (case for case in self.cases if case.optimised == self.study.main_criterion)
        plans = [case.plan for case in of_main if case.kind == "optimised" and case.plan]
        return max(plans, key=lambda plan: plan.experiments, default=None)

    @property
    def plans(self) -> dict[str, Plan]:
        """The plans by their names in the table."""
        return {case.name: case.plan for case in self.cases if case.plan is not None}

    def to_frame(self) -> "pd.DataFrame":
        """A copy of the table."""
        return self.table.copy()

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON: the table by rows, the plans and the relaxations by name.

        Values that are not finite are None.
        """
        tasks = {name: found.to_dict() for name, found in self.accuracies.items()}
        rows = self.table.astype(object).where(self.table.notna(), None)
        return {
            "title": self.study.specification.title,
            "study_sha256": self.study.digest,
            "table": rows.to_dict(orient="records"),
            "plans": {name: plan.to_dict() for name, plan in self.plans.items()},
            "relaxations": {name: plan.to_dict() for name, plan in self.relaxations.items()},
            **({} if not tasks else {"tasks": tasks}),
        }


def _plan_name(case: Case) -> str:
    """What a plan is called beside others of its size."""
    if case.kind == "optimised":
        return f"optimised for {case.optimised}"
    return f"{case.kind} ({case.label})" if case.label else case.kind
