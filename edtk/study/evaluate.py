"""The worth of a plan: all criteria, standard deviations and covariance."""

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

import criteria
from criteria.linalg.estimable import estimable_inverse, open_columns
from edtk.design.bound import printed_form
from edtk.design.plan import Plan
from edtk.findings.finding import Finding
from edtk.fit.distributions import task_accuracy
from edtk.fit.least_squares import SingularPlanError, covariance
from edtk.measure.expected_error import ErrorBudget, ExpectedError, TaskAccuracy, with_rigid
from edtk.measure.parameters import identifiable
from edtk.study.study import Study
from edtk.study.study_model import assumed_joints, springs_of
from edtk.system.errors import UserError
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd

MOST_TOLD_APART = 2  # parameters that an error tells apart in words
OBSERVABILITY = ("O1", "O2", "O3", "O4", "O5")  # indices that others also print without sigma


CriterionOf = Callable[[str], criteria.Criterion]


def criterion_values(
    study: Study, cost: Callable[[str], float], criterion: CriterionOf, has_target: bool
) -> tuple[dict[str, float], dict[str, str]]:
    """Values of all criteria that apply, and why those of other plug-ins have none.

    Args:
        study: The study, which names criteria and gives their parameters.
        cost: Cost of a plan by the criterion of a name.
        criterion: The study's criterion of a name; raises `UserError` where it has none.
        has_target: Whether there is a task, without which criteria of tasks do not apply.

    Raises:
        UserError: A criterion that the study names fails.
    """
    loaded = criteria.load_all()
    values = {}
    skipped = dict(loaded.problems)
    # Criteria that need parameters have them only where the study gives them.
    own = {name: criteria.get(name) for name in study.names if name not in loaded.problems}
    for name, known in (loaded.classes | own).items():
        if known.needs_target and not has_target:
            continue
        try:
            values[name] = printed_form(cost(name), criterion(name).sense)
        except (criteria.CriterionError, UserError) as error:
            message = error.message if isinstance(error, UserError) else str(error)
            if name in study.names:
                raise UserError(message, where=study.where) from error
            skipped[name] = message
    return values, skipped


def observability(A: Array, repeats: Indices, criterion: CriterionOf) -> dict[str, float]:
    """O1 to O5 of rows A (m, rows, p), so many times each, without division by sigma."""
    M = np.einsum("k,kri,krj->ij", repeats, A, A)
    found = {}
    for name in OBSERVABILITY:
        with suppress(UserError):  # an index that has no meaning for a part of the parameters
            found[name] = float(criterion(name).value(M))
    return found


class OpenInterestError(SingularPlanError):
    """A plan cannot identify what is of interest."""

    def __str__(self) -> str:
        return f"the plan cannot identify {' or '.join(self.parameters)}, which is of interest"


def plan_covariance(study: Study, M: Array) -> Array:
    """Covariance (p, p) of the compliances, Eq. (13), under the information M (p, p) of a plan.

    Where only some compliances are of interest, the plan may leave others open. These have infinite
    variances, and their covariances are no numbers.

    Raises:
        SingularPlanError: All compliances are of interest, and the plan cannot identify them.
        OpenInterestError: The plan cannot identify what is of interest; names it.
    """
    names = study.model.parameters
    if study.interest is None:
        return covariance(M, names)
    try:
        return covariance(M, names)
    except SingularPlanError:
        missing = criteria.create("A", interest=study.interest).missing(M, names)
        if missing:
            raise OpenInterestError(tuple(missing)) from None
    everything = np.eye(len(M))
    is_open = open_columns(M, everything)
    cov = estimable_inverse(M, everything[:, ~is_open])[1].copy()
    cov[is_open] = np.nan
    cov[:, is_open] = np.nan
    cov[is_open, is_open] = np.inf
    return cov


def accuracy_of_tasks(
    study: Study, cov: Array, k: Array | None = None, dof: float = np.inf
) -> TaskAccuracy | None:
    """Find the error to expect in each of several test poses.

    Args:
        study: The study.
        cov: Covariance (p, p) of the compliances.
        k: Identified compliances (p,); default to those of [simulation], as far as there are any.
        dof: Degrees of freedom of the covariance; inf where sigma is known.

    Returns:
        The errors; None for a single test pose, of which other lines tell, without one, and where
        the covariance leaves compliances open.
    """
    if len(study.tasks) < 2 or not np.isfinite(cov).all():
        return None
    if k is None and study.specification.simulation is not None:
        k = study.compliances
    before = None if k is None else _displacements(study, k)
    is_path = study.specification.task is not None
    return task_accuracy(study.tasks, cov, before, dof, is_path)


def _displacements(study: Study, k: Array) -> Array:
    """Displacement (t,) of the tool point by the load of each task, with all other joints [m]."""
    others = assumed_joints(study, k)
    tasks = study.tasks.with_unknown((*study.unknown, *(one.index for one in others)))
    every = np.append(k, [one.compliance for one in others])
    rows = [task.regressor for task in tasks]
    moved = [np.linalg.norm(A @ every) for A in rows]
    return with_rigid(moved, np.stack(rows)[..., len(k) :], others)


@dataclass(frozen=True, eq=False, kw_only=True)
class Evaluation(Presented):
    """The worth of a plan, in SI units throughout.

    Attributes:
        criteria: Value of every criterion that applies, by name; rho0 in metres.
        observability_unscaled: O1 to O5 from the singular values of A itself, not of A/sigma.
        covariance: Covariance (p, p) of the compliances, Eq. (13) [(rad/(N m))^2].
        parameters: Names (p,) of the parameters.
        units: Units (p,) of the parameters.
        experiments: Number of measurements.
        skipped: Why criteria of plug-ins have no value, by name: they do not load, or fail.
        warnings: What is hard to believe in the study or in this plan, a line each.
        expected: Errors to expect in the test pose and around it; None without a test pose.
        tasks: Errors to expect in each of several test poses; None for one or none.
        error_budget: The error to expect in the task, in parts; None where nothing tells it.
        with_prior: Whether the study's prior counts beside the plan.
        joints: Names (p,) of their joints.
        labels: What criteria are called that are about a part of the compliances, by name.
        interest: Standard deviations of the combinations that are of interest, by their words
            [rad/(N m)]; none if all compliances are.
    """

    criteria: dict[str, float]
    observability_unscaled: dict[str, float]
    covariance: Array
    parameters: tuple[Any, ...]
    units: tuple[str, ...]
    experiments: int
    skipped: dict[str, str]
    warnings: tuple[Finding, ...]
    expected: ExpectedError | None = None
    tasks: TaskAccuracy | None = None
    error_budget: ErrorBudget | None = None
    with_prior: bool = False
    joints: tuple[str, ...] = ()
    labels: dict[str, str] = field(default_factory=dict)
    interest: dict[str, float] = field(default_factory=dict)

    def headline(self) -> str:
        """Number of experiments, of criteria and of parameters."""
        return (
            f"{self.experiments} experiments under {len(self.criteria)} criteria, "
            f"standard deviations of {len(self.parameters)} parameters"
        )

    @cached_property
    def std(self) -> Array:
        """Standard deviations (p,) of the parameters in their units."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def names(self) -> tuple[str, ...]:
        """Names (p,) of the parameters."""
        return self.parameters

    def to_frame(self) -> "pd.DataFrame":
        """A table with a criterion a row, by name: value, sense, title and formula."""
        import pandas as pd

        classes = [criteria.get(name) for name in self.criteria]
        return pd.DataFrame(
            {
                "value": list(self.criteria.values()),
                "sense": [criterion.sense for criterion in classes],
                "title": [criterion.title for criterion in classes],
                "formula": [criterion.formula for criterion in classes],
            },
            index=pd.Index(list(self.criteria), name="criterion"),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON."""
        keys = self.joints or self.names
        return {
            "criteria": self.criteria,
            "observability_unscaled": self.observability_unscaled,
            "std": dict(zip(keys, self.std.tolist(), strict=True)),
            "covariance": self.covariance.tolist(),
            "parameters": list(self.names),
            "experiments": self.experiments,
            "expected_error": None if self.expected is None else self.expected.to_dict(),
            **({} if self.tasks is None else {"tasks": self.tasks.to_dict()}),
            "budget_mm": None if self.error_budget is None else self.error_budget.to_dict(),
            "skipped": self.skipped,
            "warnings": [one.words for one in self.warnings],
            **({"with_prior": True} if self.with_prior else {}),
            **({"interest": self.interest} if self.interest else {}),
        }


def in_words(study: Study, plan: Plan, error: SingularPlanError) -> SingularPlanError:
    """An error of what a plan leaves open, with what cannot be told from what in its poses."""
    rows = read_regressor(study, plan).reshape(-1, study.model.p)
    words = identifiable(rows, springs_of(study)).words
    return SingularPlanError(error.parameters, error.directions, words[:MOST_TOLD_APART])


def read_regressor(study: Study, plan: Plan) -> Array:
    """Regressors (m, rows, p) of a plan; rows that are not read are zero."""
    A = study.model.regressor(plan.q, plan.wrench)
    return A if study.sight is None else A * study.sight.rows(plan.q)[..., None]


def labels_of(study: Study, names: Iterable[str]) -> dict[str, str]:
    """What criteria are called that are about a part of the compliances, by name."""
    if study.interest is None and study.specification.criterion is None:
        return {}
    return {name: label for name in names if (label := study.criterion(name).label) != name}


def interest_of(study: Study, M: Array) -> dict[str, float]:
    """Standard deviations of what is of interest, by its words."""
    assert study.interest is not None
    found = criteria.Interest(criteria.create("A"), study.interest, study.interest_names)
    _, cov, _ = found.inverse(M)
    variance = found.variance(cov)
    return dict(zip(found.names, np.sqrt(np.diag(variance)).tolist(), strict=True))
