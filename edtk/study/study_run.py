"""The result of a whole study, its table of comparison and its files."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import criteria
from edtk.design.bound import Bound, printed_form
from edtk.design.exact.exact_plan import ExactPlan, NoPlanError
from edtk.design.exact.find_plan import SearchOptions, find_plan
from edtk.design.plan import Plan
from edtk.design.relaxation.relax_poses import RelaxOptions
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.findings.finding import Finding
from edtk.fit.least_squares import SingularPlanError, covariance
from edtk.measure.cells import csv_text
from edtk.measure.expected_error import (
    ErrorBudget,
    ExpectedError,
    TaskAccuracy,
    expected_error,
)
from edtk.measure.noise import VisitNoise
from edtk.measure.task import Tasks
from edtk.study.evaluate import (
    Evaluation,
    OpenInterestError,
    accuracy_of_tasks,
    criterion_values,
    in_words,
    interest_of,
    labels_of,
    observability,
    plan_covariance,
    read_regressor,
)
from edtk.study.plan_study import Sought, plan_study
from edtk.study.plausibility import plan_plausibility
from edtk.study.study import Study
from edtk.system.errors import ArgumentError
from edtk.system.files import Content
from edtk.system.presented import Presented
from edtk.system.typing import Array
from edtk.version import __version__

if TYPE_CHECKING:
    import pandas as pd

# Relative gap of the search over all poses: tables show efficiencies to 0.1 %.
TABLE_TOLERANCE = 1e-4
ERRORS = ("error_test_pose", "error_mean", "error_largest")
KINDS = ("optimised", "distinct", "random")  # of plans that a run makes


@dataclass(frozen=True, eq=False)
class Case:
    """One plan of the comparison, or the question for it.

    Attributes:
        kind: "optimised", "distinct", "published" or "random".
        optimised: Name of the criterion that it is optimised for, or "".
        size: Number of experiments m.
        distinct: Number of distinct poses, at most; None for any.
        plan: The plan; None before it is found, or if there is no such plan.
        found: How it was found, with its bound; None for plans that were not searched for.
        reason: Why there is no such plan, or "".
        label: What tells it from other plans of its kind and size: the file of a published plan.
    """

    kind: str
    optimised: str
    size: int
    distinct: int | None = None
    plan: Plan | None = None
    found: ExactPlan | None = None
    reason: str = ""
    label: str = ""

    @property
    def name(self) -> str:
        """Name in tables, and of the plan's file."""
        distinct = f"k{self.distinct}" if self.distinct else ""
        parts = (self.kind, self.optimised, f"m{self.size}", distinct, self.label)
        return "_".join(filter(None, parts))


def relaxation_key(name: str, size: int | None) -> str:
    """What the relaxation under a criterion is called in a run.

    Args:
        name: Name of the criterion.
        size: Number of experiments, where the relaxation depends on it: a prior counts the less,
            the more experiments share it.
    """
    return name if size is None else f"{name}_m{size}"


def bound_for(relaxations: Mapping[str, RelaxedPlan], name: str, size: int) -> Bound | None:
    """The best bound on plans of so many experiments; None where no relaxation gives one.

    Args:
        relaxations: Relaxations of a run by `relaxation_key`.
        name: Name of the criterion.
        size: Number of experiments.
    """
    for key in (relaxation_key(name, None), relaxation_key(name, size)):
        if key in relaxations:
            return relaxations[key].best_bound.scaled(size)
    return None


@dataclass(frozen=True, eq=False)
class Designs(Sought):
    """What a run asks about the designs of a study; kinds of study override what is theirs."""

    def relax_options(self) -> RelaxOptions:
        """How accurate relaxations over all poses are."""
        return RelaxOptions(tolerance=TABLE_TOLERANCE)

    @property
    def budget(self) -> float | None:
        """What a day may cost; None where the study does not say."""
        costs = self.study.specification.costs
        return None if costs is None else costs.budget

    def distinct(self, sizes: range) -> range:
        """Numbers of distinct poses, of those below a size, for which plans are searched, too.

        There are none within a budget of costs.
        """
        return sizes if self.budget is None else range(0)

    def search(self, relaxed: RelaxedPlan, case: Case, starts: int) -> ExactPlan:
        """The best plan of a case, within the study's budget of costs if it has one.

        Raises:
            NoPlanError: So few experiments tell too little, or the budget does not pay for them.
        """
        if self.budget is None:
            return self.of_size(relaxed, case, starts)
        try:
            # Given here, a budget that pays for too little is an error of this call.
            found = plan_study(
                self.study,
                case.size,
                case.optimised,
                cost_budget=self.budget,
                sought=type(self),
            )
        except ArgumentError as error:
            raise NoPlanError(error.message) from error
        plain = {field.name: getattr(found, field.name) for field in fields(ExactPlan)}
        return replace(ExactPlan(**plain), relaxed=relaxed, warnings=())

    def of_size(self, relaxed: RelaxedPlan, case: Case, starts: int) -> ExactPlan:
        """The best plan of a case, whatever it costs.

        Raises:
            NoPlanError: There is no such plan, as so few experiments tell too little.
        """
        options = SearchOptions(seed=self.study.specification.seed, starts=starts)
        return find_plan(relaxed, case.size, case.distinct, options=options)

    @property
    def tasks(self) -> Tasks:
        """The study's tasks, in which errors of the parameters of a plan do harm."""
        return self.study.designed.tasks

    @property
    def is_told(self) -> bool:
        """Whether feasible poses tell all that does harm around the test poses."""
        return True

    @property
    def noise(self) -> VisitNoise | None:
        """The noise of visits; None where readings have a white one."""
        return self.study.designed.noise

    def covariance(self, plan: Plan) -> Array | None:
        """Covariance (p, p) of the parameters; None where the plan leaves any open."""
        design = self.study.designed
        try:
            return np.asarray(covariance(design.information(plan), design.model.parameters))
        except SingularPlanError:
            return None

    def expected(self, plan: Plan) -> ExpectedError | None:
        """Errors to expect in the test poses and around them.

        Returns:
            The errors; None without test poses, where the plan leaves a parameter open, or where
            something that no feasible pose tells does harm around a test pose.
        """
        cov = self.covariance(plan) if self.tasks else None
        if cov is None or not self.is_told:
            return None
        found = expected_error(self.tasks, cov)
        shares = self.noise is not None and self.noise.shares
        return replace(found, by="noise and model errors of the visits") if shares else found

    def accuracy(self, plan: Plan) -> TaskAccuracy | None:
        """Errors to expect in each of several test poses; None where nothing tells them."""
        cov = self.covariance(plan) if len(self.tasks) > 1 else None
        return None if cov is None else self.in_each_task(cov)

    def in_each_task(self, cov: Array) -> TaskAccuracy | None:
        """The same of parameters with a covariance (p, p)."""
        return accuracy_of_tasks(self.study.designed, cov)

    def totals(self, plan: Plan) -> TaskAccuracy | None:
        """The same with the total of each, of all that is uncertain, where it is known."""
        return self.accuracy(plan)

    def error_budget(self, plan: Plan) -> ErrorBudget | None:
        """The error in the test poses by all that is uncertain; None where nothing tells it."""
        return None

    def warnings(
        self,
        plan: Plan,
        expected: ExpectedError | None,
        criterion: criteria.Criterion | None = None,
    ) -> tuple[Finding, ...]:
        """What is hard to believe in a plan for a criterion and in what to expect, a line each."""
        return plan_plausibility(self.study, plan, expected)

    def promised(self, found: ExactPlan) -> ExactPlan:
        """A plan with its errors in the task, and with what is hard to believe in these."""
        plan = found.whole
        expected = self.expected(plan)
        return replace(
            found,
            warnings=found.warnings + self.warnings(plan, expected, found.relaxed.criterion),
            expected=expected,
            tasks=self.totals(plan),
            error_budget=self.error_budget(plan),
        )

    def evaluate(self, plan: Plan) -> Evaluation:
        """Score a plan under every criterion that the study can evaluate.

        Criteria that need a target are left out if the study has no test pose.

        Args:
            plan: The plan, whether or not its poses are feasible.

        Raises:
            SingularPlanError: The plan cannot identify all parameters; names them.
            UserError: A plug-in's criterion that the study names fails.
        """
        study, design = self.study, self.study.designed
        M = design.information(plan)
        try:
            every = plan_covariance(design, M)
        except OpenInterestError:
            raise
        except SingularPlanError as error:
            raise in_words(design, plan, error) from None
        own = slice(len(study.unknown))
        told = self.judged(plan)
        return Evaluation(
            **told,
            covariance=every[own, own],
            parameters=study.model.parameters,
            units=study.model.units,
            joints=study.specification.joints.unknown,
            labels=labels_of(study, told["criteria"]),
            interest={} if study.interest is None else interest_of(design, M),
        )

    def judged(self, plan: Plan, is_whole: bool = True) -> dict[str, Any]:
        """Fields of an `Evaluation` that follow from criteria and from the test poses.

        Args:
            plan: The plan.
            is_whole: Whether it tells all parameters; else criteria of them have no value.
        """
        study = self.study
        names = [name for name in study.names if not criteria.get(name).needs_target]
        values: dict[str, float] = {}
        skipped = dict.fromkeys(names, "the plan leaves parameters open")
        if is_whole:
            values, skipped = criterion_values(
                study, partial(self.cost, plan), self.criterion, bool(study.tasks)
            )
        expected = self.expected(plan)
        return {
            "criteria": values,
            "observability_unscaled": self.unscaled(plan) if is_whole else {},
            "experiments": plan.experiments,
            "expected": expected,
            "tasks": self.totals(plan),
            "error_budget": self.error_budget(plan),
            "skipped": skipped,
            "warnings": study.warnings + self.warnings(plan, expected),
            "with_prior": self.counts_prior,
        }

    @property
    def counts_prior(self) -> bool:
        """Whether what the study says was known before counts beside plans."""
        return self.study.prior_information is not None

    def unscaled(self, plan: Plan) -> dict[str, float]:
        """O1 to O5 of the stacked regressor, without division by the noise."""
        rows = read_regressor(self.study, plan)
        return observability(rows, plan.repeats, self.study.criterion)


def comparison_table(
    designs: Designs, cases: Iterable[Case], relaxations: Mapping[str, RelaxedPlan]
) -> "pd.DataFrame":
    """Compare plans under all criteria of a study.

    Args:
        designs: The designs of the study.
        cases: The plans; one that does not exist has a row with its reason and without values.
        relaxations: Relaxations by `relaxation_key`, whose bounds efficiencies refer to.

    Returns:
        One row a plan: what it is; the value of each criterion [SI units]; its efficiency under
        each criterion with a relaxation, which is the best bound divided by its cost; with a test
        pose, the errors to expect there and around it [m]; seed, digest of the study and version.
    """
    import pandas as pd

    return pd.DataFrame([_row(designs, case, relaxations) for case in cases])


def _row(designs: Designs, case: Case, relaxations: Mapping[str, RelaxedPlan]) -> dict[str, Any]:
    study = designs.study
    row: dict[str, Any] = {
        "plan": case.name,
        "kind": case.kind,
        "optimised_for": case.optimised,
        "experiments": case.size,
        "distinct_at_most": case.distinct or case.size,
        "poses": 0 if case.plan is None else len(case.plan.q),
        "reason": case.reason,
    }
    relaxed = dict.fromkeys(one.criterion.name for one in relaxations.values())
    costs = {
        name: np.inf if case.plan is None else designs.cost(case.plan, name)
        for name in dict.fromkeys([*study.specification.criteria, *relaxed])
    }
    for name in study.specification.criteria:
        value = printed_form(costs[name], designs.criterion(name).sense)
        row[name] = np.nan if case.plan is None else value
    for name in relaxed:
        bound = bound_for(relaxations, name, case.size)
        row[f"efficiency_{name}"] = np.nan if bound is None else bound.efficiency(costs[name])
    if study.tasks:
        row |= _errors(designs, case)
    return row | {
        "seed": study.specification.seed,
        "study_sha256": study.digest,
        "edtk": __version__,
    }


def _errors(designs: Designs, case: Case) -> dict[str, float]:
    """The errors that a plan promises in the test pose and around it [m]; NaN where it has none."""
    found = None if case.plan is None else designs.expected(case.plan)
    if found is None:
        return dict.fromkeys(ERRORS, np.nan)
    return dict(zip(ERRORS, (found.test_pose, found.mean, found.largest), strict=True))


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
        cut: Names of relaxations and searches that the end of the time has cut off or left out.
    """

    study: Study
    table: "pd.DataFrame"
    relaxations: Mapping[str, RelaxedPlan]
    cases: tuple[Case, ...]
    folder: Path
    own_designs: Designs | None = None
    cut: frozenset[str] = frozenset()

    @property
    def ended(self) -> str:
        """Why the run ended: "budget" where the time has cut something off, else "finished"."""
        return "budget" if self.cut else "finished"

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
    def warnings(self) -> tuple[Finding, ...]:
        """What is hard to believe in the study or in that plan, a line each."""
        of_plan = () if self.best is None else self.designs.warnings(self.best, self.expected)
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
            "ended": self.ended,
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


def run_files(run: StudyRun) -> dict[Path, Content]:
    """The contents of `results.csv` and of every plan that the run has made, by path.

    Published plans have files of their own.
    """
    robot = run.study.robot
    files: dict[Path, Content] = {
        run.folder / "plans" / f"{case.name}.csv": csv_text(case.plan.to_frame(robot))
        for case in run.cases
        if case.plan is not None and case.kind in KINDS
    }
    return files | {run.folder / "results.csv": csv_text(run.table)}
