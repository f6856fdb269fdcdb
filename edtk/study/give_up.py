"""Plans that give up a part of their criterion for a second one: efficiency-constrained designs."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from criteria import Criterion, CriterionError
from criteria.compound import Compound
from edtk.design.bound import printed_form
from edtk.design.exact.day import DayPlan
from edtk.design.exact.exact_plan import Compromise, ExactPlan
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.system.errors import ArgumentError
from edtk.system.time_limit import out_of_time
from edtk.system.typing import Array

HALVINGS = 12  # of the range of weights, of which one is found to a four-thousandth
MOST_WEIGHT = (
    1 - 2.0**-HALVINGS
)  # of the second criterion; the first one keeps all tied designs apart
PLANS_TRIED = 4  # plans that are searched until one gives up about as much as allowed
ENOUGH = 0.8  # of what is allowed
WEIGHED_POSES = 2000  # poses over which weights are found; plans are searched over all
PERCENT = 100.0


@dataclass(frozen=True)
class Exchange:
    """The first criterion, of which a part may be given up, and the second one.

    A design that is best for the second criterion among those whose efficiency for the first is at
    least 1 - x is best for a compound criterion ``f_1^(1-a) f_2^a`` of the losses, too: both sets
    of information matrices are convex, and a is the multiplier of the constraint (Cook and Wong,
    J. Am. Stat. Assoc. 89, 1994; Atkinson, Donev and Tobias, chapter 21).

    Attributes:
        first: The criterion that the study is about.
        second: The other one.
        allowed: The share x of the first that may be given up, as cost: ``1 - best/cost``.
    """

    first: Criterion
    second: Criterion
    allowed: float
    name: ClassVar[str] = "compound"

    @classmethod
    def of(cls, first: Criterion, second: Criterion, allowed: float) -> "Exchange":
        """The exchange, if both can be parts of a compound criterion.

        Raises:
            ArgumentError: The second one cannot, or the first.
        """
        try:
            Compound([first, second])
        except CriterionError as error:
            raise ArgumentError(str(error), argument="second", given=second.label) from error
        return cls(first, second, allowed)

    def compound(self, weight: float) -> dict[str, Any]:
        """Both criteria as one, the second with this weight."""
        parts = [self.first.to_dict(), self.second.to_dict()]
        return {"name": self.name, "criteria": parts, "weights": [1 - weight, weight]}

    def given_up(self, M: Array, best: float) -> float:
        """Share of the first criterion that a design with the information M (p, p) gives up."""
        return 1.0 - best / float(self.first.cost(M))

    def weight_of(
        self, best: RelaxedPlan, relaxed: Callable[[float], RelaxedPlan], allowed: float
    ) -> float:
        """The largest weight of the second criterion whose best weights give up no more.

        What they give up grows with the weight, so that halving finds it.

        Args:
            best: The best weights for the first criterion alone.
            relaxed: The best weights for both, by the weight of the second.
            allowed: The share that may be given up.
        """

        def gives_up(weight: float) -> float:
            return self.given_up(relaxed(weight).information, best.cost)

        if gives_up(MOST_WEIGHT) <= allowed:
            return MOST_WEIGHT
        low, high = 0.0, MOST_WEIGHT
        for _ in range(HALVINGS):
            if out_of_time():
                break
            middle = (low + high) / 2
            low, high = (middle, high) if gives_up(middle) <= allowed else (low, middle)
        return low


def give_up(
    exchange: Exchange,
    alone: ExactPlan,
    best: RelaxedPlan,
    relaxed: Callable[[float], RelaxedPlan],
    searched: Callable[[float], ExactPlan],
    information: Callable[[ExactPlan], Array],
) -> ExactPlan:
    """The plan that is best for the second criterion of those that give up no more than allowed.

    The weight is that of the best weights; a plan of few experiments may give up more, and others
    are then searched with smaller ones. What is given up is counted from the plan that was found
    for the first criterion alone; the bound of that search holds for this plan, too.

    Args:
        exchange: The criteria.
        alone: The plan for the first criterion alone.
        best: The best weights for it over the same candidates as those of `relaxed`.
        relaxed: The best weights for both criteria, by the weight of the second.
        searched: The best plan for both, likewise.
        information: Information (p, p) of all experiments of a plan, and of what is known besides.

    Returns:
        The plan under the first criterion, with its `compromise`; the one for the first alone where
        no other gains anything, or the time is over (`time_limit`).
    """
    before = information(alone)
    chosen = alone
    weight = 0.0
    least = float(exchange.second.cost(before))
    # Shares that the best weights may give up: one that plans kept, and one that they did not.
    kept, broken = 0.0, None
    share = exchange.allowed
    for _ in range(PLANS_TRIED):
        if out_of_time():
            break
        tried = exchange.weight_of(best, relaxed, share)
        if not tried > 0:
            break
        found = searched(tried)
        M = information(found)
        lost = exchange.given_up(M, alone.cost)
        cost = float(exchange.second.cost(M))
        if lost <= exchange.allowed and cost < least:
            chosen, weight, least = found, tried, cost
        if found.ended == "interrupted":
            chosen = replace(chosen, ended=found.ended)
            break
        kept, broken = (share, broken) if lost <= exchange.allowed else (kept, share)
        if broken is None or ENOUGH * exchange.allowed <= lost <= exchange.allowed:
            break
        share = (kept + broken) / 2
    if out_of_time() and chosen.ended != "interrupted":
        chosen = replace(chosen, ended="budget")
    return _under_first(exchange, alone, chosen, weight, before, information(chosen))


def _under_first(
    exchange: Exchange, alone: ExactPlan, chosen: ExactPlan, weight: float, before: Array, M: Array
) -> ExactPlan:
    """The chosen plan with the bound of the first criterion, and what was exchanged."""
    second = exchange.second
    costs = float(second.cost(before)), float(second.cost(M))
    compromise = Compromise(
        second=second.label,
        weight=weight,
        allowed=exchange.allowed,
        given_up=exchange.given_up(M, alone.cost),
        value_alone=alone.value,
        second_alone=printed_form(costs[0], second.sense),
        second_value=printed_form(costs[1], second.sense),
        times=(costs[0] / costs[1]) ** (1 / second.degree),
        shown=second.shown,
    )
    cost = float(exchange.first.cost(M))
    seconds = alone.seconds if chosen is alone else alone.seconds + chosen.seconds
    of_first: dict[str, Any] = {"relaxed": alone.relaxed}
    if isinstance(alone, DayPlan):
        of_first |= {one: getattr(alone, one) for one in ("bound_of_all", "tried", "proofs")}
    return replace(chosen, cost=cost, seconds=seconds, compromise=compromise, **of_first)
