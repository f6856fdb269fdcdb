"""A relaxation under another criterion that puts plans in the same order."""

from dataclasses import replace

from criteria import Relaxable
from edtk.design.bound import Bound
from edtk.design.relaxation.relaxed_plan import RelaxedPlan


def relaxed_under(criterion: Relaxable, relaxed: RelaxedPlan) -> RelaxedPlan:
    """The relaxation under a criterion, from that under its `plan_criterion`.

    O1 = D^(1/2) is greater where D is, so D's weights are O1's, and each bound on the cost of D is
    turned into one on that of O1 by the same increasing function. The multipliers prove both.

    Args:
        criterion: The criterion.
        relaxed: The relaxation under `criterion.plan_criterion`.
    """
    if criterion.name == relaxed.criterion.name:
        return relaxed
    cost = criterion.cost_from_plan_criterion(relaxed.cost)

    def turned(bound: Bound) -> Bound:
        return Bound.of(criterion, criterion.cost_from_plan_criterion(bound.cost), cost, bound.kind)

    searched = relaxed.searched_bound
    return replace(
        relaxed,
        criterion=criterion,
        cost=cost,
        proved_bound=turned(relaxed.proved_bound),
        searched_bound=None if searched is None else turned(searched),
    )
