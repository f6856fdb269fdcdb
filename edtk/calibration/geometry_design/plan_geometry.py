"""The plan and the relaxation that a study of geometry asks for."""

import numpy as np

from edtk.calibration.geometry_design.geometry_plan import GeometryPlan
from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.design.candidate_source import CandidateSource
from edtk.design.enclosure.prove_continuum import prove_poses
from edtk.design.exact.day import MOST_VISITS, DayPlan
from edtk.design.exact.day_search import DaySearch
from edtk.design.exact.exact_plan import NoPlanError, TooFewExperimentsError, require_enough
from edtk.design.plan import Plan
from edtk.design.relaxation.relax import require_relaxable
from edtk.design.relaxation.relax_poses import DEFAULT_MB, RelaxOptions, relax_poses
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.measure.measured_model import MeasuredModel
from edtk.study.plan_study import (
    DEFAULTS,
    RunOptions,
    day_costs,
    error_of_costs,
    new_experiments,
    require_few_loads,
    source_of,
    study_errors,
)
from edtk.study.study import Study
from edtk.system.errors import ArgumentError
from edtk.system.time_limit import time_limit
from edtk.system.typing import Array

# Relative gap at which a search over all poses ends. Designs of 35 parameters rest on a hundred
# poses and more, whose last digits would take minutes.
TOLERANCE = 1e-3
OF_PLANS = 2e-2  # that of the bound of a plan: one of 35 parameters would take minutes to 1e-3
SEARCHES = 12  # over all poses for the bound, at most: what is left after them is a per cent or two


def relax_geometry(
    study: Study,
    criterion: str | None = None,
    *,
    candidates: int | None = None,
    continuous: bool = False,
    prove: float | None = None,
    size: int | None = None,
    tolerance: float = TOLERANCE,
    near: Array | None = None,
    memory_mb: float = DEFAULT_MB,
    options: RunOptions = DEFAULTS,
) -> RelaxedPlan:
    """Find the best weights over poses, without and with a load, with a bound on every plan.

    Args:
        study: The study, with [parameters].
        criterion: Name of a criterion; defaults to the one that the study is about.
        candidates: Number of candidate visits; defaults to the study's.
        continuous: Whether to search over all feasible poses, beyond the candidates.
        prove: Relative gap up to which the bound is proved for all feasible poses; None for none.
        size: Number of visits that share what is known besides, where that counts in designs;
            defaults to the first of the study's sizes.
        tolerance: Relative gap at which that search ends.
        near: Feasible visits (k, v) with which that search begins besides.
        memory_mb: Limit on memory [MB].
        options: Seed, progress, and what does the work: the result does not depend on that.

    Raises:
        UserError: One line that says what cannot be done, and where.
        PlanInterrupted: Ctrl-C after a first certified plan, which it carries.
    """
    with study_errors(study):
        question = GeometryQuestion.of(study)
        if size is not None and question.prior is None:
            message = "has no effect without a prior in the design; expected none"
            raise ArgumentError(message, argument="size", given=size)
        space = question.space_for(size or study.specification.sizes[0])
        source: CandidateSource = source_of(study, options.seed, space, options.threads)
        how = RelaxOptions(
            tolerance=tolerance,
            memory_mb=memory_mb,
            workers=options.workers,
            progress=options.progress,
        )
        number = study.specification.candidates if candidates is None else candidates
        asked = question.criterion(criterion)
        if prove is not None:
            return prove_poses(source, number, asked, prove, how)
        return relax_poses(source, number, asked, continuous, how, near)


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

    Without a budget all loads are there to choose from, and the size alone decides; with one, see
    `DaySearch`.

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
        search = _search(question, size, criterion, kept, cost_budget, distinct, options)
        try:
            found = _found(question, search)
        except ArgumentError as error:
            raise error_of_costs(study, error, cost_budget) from error
    return _judged(question, found)


def _search(
    question: GeometryQuestion,
    size: int | None,
    criterion: str | None,
    kept: Plan | None,
    cost_budget: float | None,
    distinct: int | None,
    options: RunOptions,
) -> DaySearch:
    """The search for the plan of a day.

    Raises:
        ArgumentError: One of the arguments is impossible.
    """
    study = question.study
    costs = day_costs(study, cost_budget)
    wrenches = None if question.chooses_forces else question.wrenches
    require_few_loads(study, costs, wrenches)
    new = new_experiments(size, distinct, kept, costs, "visits")
    if new is not None and new > MOST_VISITS:
        message = f"plans of more than {MOST_VISITS} new visits are not searched for"
        raise ArgumentError(message, argument="size", given=size)
    known = question.prior if kept is None else question.information(kept)
    return DaySearch(
        source=source_of(study, options.seed, question.space),
        candidates=study.specification.candidates,
        wrenches=wrenches,
        criterion=require_relaxable(question.criterion(criterion)),
        known=known,
        kept=kept,
        new=new,
        costs=costs,
        distinct=distinct,
        seed=study.specification.seed if options.seed is None else options.seed,
        relax=RelaxOptions(tolerance=OF_PLANS, workers=options.workers),
        searches=SEARCHES,
        workers=options.workers,
        progress=options.progress,
    )


def _found(question: GeometryQuestion, search: DaySearch) -> DayPlan:
    """What the search finds.

    Raises:
        ArgumentError: Visits are too few, or the budget pays for none or for too many.
    """
    try:
        _require_enough(question, search)
        return search.run()
    except NoPlanError as error:
        raise _too_few(question, search, error) from error


def _require_enough(question: GeometryQuestion, search: DaySearch) -> None:
    """Check that visits are enough to tell all parameters apart, before any search.

    Raises:
        ArgumentError: The budget pays for no plan, or for too many visits.
        TooFewExperimentsError: They are not enough.
    """
    most = search.budget.most()
    model = question.model
    rows = most * model.row_count * len(model.markers)
    places = most if search.distinct is None or search.new is None else search.distinct
    if search.known is not None or not search.criterion.needs_all:
        return
    # Twice as many rows as parameters are enough, wherever markers are not in one place.
    if places < most or rows < 2 * model.p:
        require_enough(question.space, most, places, search.criterion)


def _too_few(question: GeometryQuestion, search: DaySearch, error: NoPlanError) -> ArgumentError:
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


def _judged(question: GeometryQuestion, found: DayPlan) -> GeometryPlan:
    """The plan with its cost by rows, and with its error in the test poses."""
    M = question.information(found.whole)
    rho0 = None
    if question.target is not None:
        rho0 = float(question.criterion("rho0").value(M))
    given = {name: getattr(found, name) for name in found.__dataclass_fields__}
    given |= {
        "cost": float(found.relaxed.criterion.cost(M)),
        "with_prior": question.prior is not None,
        "warnings": question.study.warnings,
    }
    return GeometryPlan(**given, question=question, rho0=rho0)
