"""The plan that a study of geometry asks for: visits, loads and what the day may cost."""

import numpy as np

from edtk.calibration.geometry_design.day_search import DaySearch
from edtk.calibration.geometry_design.geometry_plan import GeometryPlan
from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.design.plan import Plan
from edtk.study.run_options import DEFAULTS, RunOptions
from edtk.study.study import Study
from edtk.study.study_errors import study_errors
from edtk.system.errors import ArgumentError
from edtk.system.time_limit import time_limit


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
