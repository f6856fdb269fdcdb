"""How many visits tell what a study of geometry asks, and a plan of them with what it tells."""

from edtk.calibration.geometry_design.geometry_plan import GeometryPlan
from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.design.exact.day_search import DaySearch
from edtk.design.exact.exact_plan import (
    ExactPlan,
    NoPlanError,
    TooFewExperimentsError,
    require_enough,
)
from edtk.measure.measured_model import MeasuredModel
from edtk.system.errors import ArgumentError


def require_enough_visits(question: GeometryQuestion, search: DaySearch, most: int) -> None:
    """Check that visits are enough to tell all parameters apart, before any search.

    Raises:
        TooFewExperimentsError: They are not enough.
    """
    model = question.model
    rows = most * model.row_count * len(model.markers)
    places = most if search.distinct is None or search.new is None else search.distinct
    if search.known is not None or not search.criterion.needs_all:
        return
    # Twice as many rows as parameters are enough, wherever markers are not in one place.
    if places < most or rows < 2 * model.p:
        require_enough(question.space, most, places, search.criterion)


def too_few_visits(
    question: GeometryQuestion, search: DaySearch, error: NoPlanError
) -> ArgumentError:
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


def with_question(question: GeometryQuestion, found: ExactPlan) -> GeometryPlan:
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
