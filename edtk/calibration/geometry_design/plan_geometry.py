"""The plan and the relaxation that a study of geometry asks for."""

import numpy as np

from edtk.calibration.geometry_design.day_search import DaySearch
from edtk.calibration.geometry_design.geometry_plan import GeometryPlan
from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.design.candidate_source import CandidateSource
from edtk.design.plan import Plan
from edtk.design.relaxation.relax_poses import DEFAULT_MB, RelaxOptions, relax_poses
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.study.plan_study import DEFAULTS, RunOptions, source_of, study_errors
from edtk.study.study import Study
from edtk.system.errors import ArgumentError
from edtk.system.time_limit import time_limit

# Relative gap at which a search over all poses ends. Designs of 35 parameters rest on a hundred
# poses and more, whose last digits would take minutes.
TOLERANCE = 1e-3


def relax_geometry(
    study: Study,
    criterion: str | None = None,
    *,
    candidates: int | None = None,
    continuous: bool = False,
    memory_mb: float = DEFAULT_MB,
    options: RunOptions = DEFAULTS,
) -> RelaxedPlan:
    """Find the best weights over poses, without and with a load, with a bound on every plan.

    Args:
        study: The study, with [parameters].
        criterion: Name of a criterion; defaults to the one that the study is about.
        candidates: Number of candidate visits; defaults to the study's.
        continuous: Whether to search over all feasible poses, beyond the candidates.
        memory_mb: Limit on memory [MB].
        options: Seed and progress.

    Raises:
        UserError: One line that says what cannot be done, and where.
        PlanInterrupted: Ctrl-C after a first certified plan, which it carries.
    """
    with study_errors(study):
        question = GeometryQuestion.of(study)
        source: CandidateSource = source_of(study, options.seed, question.space)
        return relax_poses(
            source,
            study.specification.candidates if candidates is None else candidates,
            question.criterion(criterion),
            continuous,
            RelaxOptions(tolerance=TOLERANCE, memory_mb=memory_mb, progress=options.progress),
        )


def plan_geometry(
    study: Study,
    size: int | None = None,
    criterion: str | None = None,
    *,
    distinct: int | None = None,
    kept: Plan | None = None,
    cost_budget: float | None = None,
    seconds: float | None = None,
    options: RunOptions = DEFAULTS,
) -> GeometryPlan:
    """Search for the best visits of poses, without and with a load, with a bound on every plan.

    Without a budget all loads are there to choose from, and the size alone decides. With one, a
    plan of several loads has to pay for load changes: the best plans of each set of loads, none
    counted as one, are searched within what the budget leaves, and the best of them is taken. A set
    whose bound is no better than a plan that was found already is not searched.

    Args:
        study: The study, with [parameters].
        size: Number of visits in all, kept ones counted; None where the budget decides.
        criterion: Name of a criterion; defaults to the one that the study is about.
        distinct: Different new visits at most; a pose without a load and under it are two.
            Defaults to any number.
        kept: Visits that were made already; they cost nothing more.
        cost_budget: What the new visits may cost; defaults to the study's.
        seconds: Time after which the best plan so far is returned; defaults to no limit. A first
            design on the candidates and a first plan, of each set of loads, are always completed.
        options: Seed and progress.

    Raises:
        UserError: One line that says what cannot be done, and where.
    """
    with study_errors(study), time_limit(np.inf if seconds is None else seconds):
        question = GeometryQuestion.of(study)
        search = DaySearch.of(question, size, criterion, kept, cost_budget, options)
        try:
            return search.limited(distinct).run()
        except ArgumentError as error:
            if error.argument != "cost_budget" or cost_budget is not None:
                raise
            # The budget is that of the study, and nobody gave an argument.
            given = "" if error.given is None else f" (got {error.given})"
            raise study.error("costs.budget", f"{error.message}{given}") from error
