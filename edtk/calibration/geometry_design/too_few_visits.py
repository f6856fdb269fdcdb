"""The error of a plan with too few visits, in words."""

from criteria import Relaxable
from edtk.design.plan import Plan
from edtk.model.geometry.geometric_model import GeometricModel
from edtk.system.errors import ArgumentError


def too_few_visits(
    model: GeometricModel,
    criterion: Relaxable,
    new: int | None,
    kept: Plan | None,
    budget: float | None,
    distinct: int | None,
    least: int | None,
) -> ArgumentError:
    """The error of visits that leave open what a criterion needs.

    Args:
        model: What the visits tell about.
        criterion: The criterion.
        new: Number of new visits; None where the budget decides.
        kept: Visits that were made already.
        budget: What the new visits may cost; None for any costs.
        distinct: Number of different new visits at most; None for any number.
        least: Visits that tell all parameters apart; defaults to those with as many rows.
    """
    if new is None and distinct is not None:
        message = f"so few different visits cannot tell what {criterion.name} needs"
        return ArgumentError(message, argument="distinct", given=distinct)
    message = f"so few visits cannot tell what {criterion.name} needs; expected more"
    if criterion.needs_all:
        message = _all_parameters(model, least)
    if new is None:
        return ArgumentError(message, argument="cost_budget", given=budget)
    count = 0 if kept is None else kept.experiments
    return ArgumentError(message, argument="size", given=new + count)


def _all_parameters(model: GeometricModel, least: int | None) -> str:
    """How many visits tell all parameters apart."""
    count = len(model.markers)
    least = least or -(-model.p // (model.row_count * count))
    poses = "full poses of " if model.rows == "pose" else ""
    plural = "s" if count > 1 else ""
    return (
        f"so few visits cannot tell {model.p} parameters apart; expected {least} or more, "
        f"each of {poses}{count} marker{plural}"
    )
