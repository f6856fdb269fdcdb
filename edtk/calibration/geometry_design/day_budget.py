"""What the costs of a day leave for visits."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from edtk.calibration.geometry_design.day_costs import DayCosts
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array

MOST_VISITS = 500
ROUNDING = 1e-9  # relative: a budget may be exceeded by the rounding of a sum


@dataclass(frozen=True, eq=False)
class DayBudget:
    """The sets of loads that a day can pay for, and how many visits of each.

    Attributes:
        wrenches: The loads (s, 6) to choose from, none counted as one [N, N m].
        new: Number of new visits; None where the budget decides.
        costs: What visits and load changes cost; None where nothing is said of costs.
    """

    wrenches: Array
    new: int | None
    costs: DayCosts | None

    def prices(self, loads: tuple[int, ...]) -> Array:
        """Costs of a visit under each of some loads."""
        if self.costs is None:
            return np.ones(len(loads))
        return self.costs.prices(self.wrenches)[list(loads)]

    def sets(self) -> Iterator[tuple[tuple[int, ...], float]]:
        """Sets of loads, and what the budget leaves for visits; infinite without a budget.

        Raises:
            ArgumentError: The budget pays for no plan.
        """
        every = tuple(range(len(self.wrenches)))
        if self.costs is None or self.costs.budget is None:
            yield every, np.inf
            return
        any_left = False
        # Large sets first: their plans are the best ones where load changes are cheap.
        for number in range(len(every), 0, -1):
            funds = self.costs.budget - self.costs.change * self.costs.changes_of(number)
            for loads in combinations(every, number):
                if affords(funds, self._least(loads)):
                    any_left = True
                    yield loads, funds
        if not any_left:
            visits = "a visit costs" if self.new is None else f"{self.new} visits cost"
            message = f"{visits} {self._least(every):g} or more"
            raise ArgumentError(message, argument="cost_budget", given=self.costs.budget)

    def _least(self, loads: tuple[int, ...]) -> float:
        """What the cheapest plan of some loads costs, load changes not counted."""
        return float(self.prices(loads).min()) * (self.new or 1)


def affords(funds: float, price: float) -> bool:
    """Whether some funds pay a price."""
    return funds * (1 + ROUNDING) >= price


def most_visits(funds: float, price: float) -> int:
    """How many visits of a price some funds pay for.

    Raises:
        ArgumentError: They are too many for a search.
    """
    number = int(np.floor(funds * (1 + ROUNDING) / price))
    if number > MOST_VISITS:
        message = f"pays for {number} visits; plans of more than {MOST_VISITS} are not searched for"
        raise ArgumentError(message, argument="cost_budget")
    return number
