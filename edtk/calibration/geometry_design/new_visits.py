"""The number of visits that a plan has to find."""

from edtk.calibration.geometry_design.day_budget import MOST_VISITS
from edtk.design.plan import Plan
from edtk.system.errors import ArgumentError


def new_visits(size: int | None, kept: Plan | None) -> int | None:
    """Number of new visits; None where the budget decides.

    Args:
        size: Number of visits in all; None where the budget decides.
        kept: Visits that were made already.

    Raises:
        ArgumentError: There is nothing to plan, or the visits are too many.
    """
    if size is None:
        return None
    count = 0 if kept is None else kept.experiments
    if size - count < 1:
        message = f"{count} experiments are kept; expected more than that"
        raise ArgumentError(message, argument="size", given=size)
    if size - count > MOST_VISITS:
        message = f"plans of more than {MOST_VISITS} new visits are not searched for"
        raise ArgumentError(message, argument="size", given=size)
    return size - count
