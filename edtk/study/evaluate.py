"""The worth of a plan: all criteria, standard deviations and covariance."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

import criteria
from edtk.design.plan import Plan
from edtk.model.expected_error import ExpectedError
from edtk.model.task_accuracy import TaskAccuracy
from edtk.study.accuracy_of_tasks import accuracy_of_tasks
from edtk.study.criteria_frame import criteria_frame
from edtk.study.criterion_values import criterion_values, observability
from edtk.study.plan_accuracy import plan_accuracy
from edtk.study.plan_covariance import plan_covariance
from edtk.study.plan_plausibility import plan_plausibility
from edtk.study.study import Study
from edtk.system.presented import Presented
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Evaluation(Presented):
    """The worth of a plan, in SI units throughout.

    Attributes:
        criteria: Value of every criterion that applies, by name; rho0 in metres.
        observability_unscaled: O1 to O5 from the singular values of A itself, not of A/sigma.
        std: Standard deviations (p,) of the compliances [rad/(N m)].
        covariance: Covariance (p, p) of the compliances, Eq. (13) [(rad/(N m))^2].
        parameters: Names (p,) of the parameters.
        joints: Names (p,) of their joints.
        units: Units (p,) of the parameters.
        experiments: Number of measurements.
        expected: Errors to expect in the test pose and around it; None without a test pose.
        tasks: Errors to expect in each of several test poses; None for one or none.
        skipped: Why criteria of plug-ins have no value, by name: they do not load, or fail.
        warnings: What is hard to believe in the study or in this plan, a line each.
        with_prior: Whether the study's prior counts beside the plan.
        labels: What criteria are called that are about a part of the compliances, by name.
        interest: Standard deviations of the combinations that are of interest, by their words
            [rad/(N m)]; none if all compliances are.
    """

    criteria: dict[str, float]
    observability_unscaled: dict[str, float]
    std: Array
    covariance: Array
    parameters: tuple[str, ...]
    joints: tuple[str, ...]
    units: tuple[str, ...]
    experiments: int
    expected: ExpectedError | None = None
    tasks: TaskAccuracy | None = None
    skipped: dict[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    with_prior: bool = False
    labels: dict[str, str] = field(default_factory=dict)
    interest: dict[str, float] = field(default_factory=dict)

    def headline(self) -> str:
        """Number of experiments, of criteria and of parameters."""
        return (
            f"{self.experiments} experiments under {len(self.criteria)} criteria, "
            f"standard deviations of {len(self.parameters)} parameters"
        )

    def to_frame(self) -> "pd.DataFrame":
        """A table with a criterion a row, by name: value [SI units], sense, title and formula."""
        return criteria_frame(self.criteria)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON."""
        return {
            "criteria": self.criteria,
            "observability_unscaled": self.observability_unscaled,
            "std": dict(zip(self.joints, self.std.tolist(), strict=True)),
            "covariance": self.covariance.tolist(),
            "parameters": list(self.parameters),
            "experiments": self.experiments,
            "expected_error": None if self.expected is None else self.expected.to_dict(),
            **({} if self.tasks is None else {"tasks": self.tasks.to_dict()}),
            "skipped": self.skipped,
            "warnings": list(self.warnings),
            **({"with_prior": True} if self.with_prior else {}),
            **({"interest": self.interest} if self.interest else {}),
        }


def evaluate(study: Study, plan: Plan) -> Evaluation:
    """Score a plan under every criterion that the study can evaluate.

    Args:
        study: The study; criteria that need a target are left out if it has no test pose.
        plan: The plan, whether or not its poses are feasible.

    Raises:
        SingularPlanError: The plan cannot identify all parameters; names them.
        UserError: A plug-in's criterion that the study names fails.
    """
    M = study.information(plan)
    cov = plan_covariance(study, M)
    has_target = study.target is not None
    expected = plan_accuracy(study, plan)
    values, skipped = criterion_values(study, M, study.criterion, has_target)
    return Evaluation(
        criteria=values,
        observability_unscaled=_unscaled(study, plan),
        std=np.sqrt(np.diag(cov)),
        covariance=cov,
        parameters=study.model.parameters,
        joints=study.specification.joints.unknown,
        units=study.model.units,
        experiments=plan.experiments,
        expected=expected,
        tasks=accuracy_of_tasks(study, cov),
        skipped=skipped,
        warnings=study.warnings + plan_plausibility(study, plan, expected),
        with_prior=study.prior_information is not None,
        labels=_labels(study, values),
        interest=_interest(study, M),
    )


def _labels(study: Study, names: Iterable[str]) -> dict[str, str]:
    """What criteria are called that are about a part of the compliances, by name."""
    if study.interest is None and study.specification.criterion is None:
        return {}
    return {name: label for name in names if (label := study.criterion(name).label) != name}


def _interest(study: Study, M: Array) -> dict[str, float]:
    """Standard deviations of what is of interest, by its words."""
    if study.interest is None:
        return {}
    found = criteria.Interest(criteria.create("A"), study.interest, study.interest_names)
    _, cov, _ = found.inverse(M)
    variance = found.variance(cov)
    return dict(zip(found.names, np.sqrt(np.diag(variance)).tolist(), strict=True))


def _unscaled(study: Study, plan: Plan) -> dict[str, float]:
    """O1 to O5 of the stacked regressor without division by sigma."""
    A = study.model.regressor(plan.q, plan.wrench)
    M = np.einsum("k,kri,krj->ij", plan.repeats, A, A)
    return observability(M, study.criterion)
