"""What a day of visits costs, and which loads it can pay for, as a certificate states it."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from edtk.certificate.recompute.plain_data import number, table, whole
from edtk.system.typing import Array

KEYS = ("visit", "loaded_visit", "load_change", "load_changes", "budget", "visits")
MOST_LOADS = 6  # of which all sets are checked, none counted as one
MOST_VISITS = 1_000_000
MOST_CHANGES = 1_000_000
ROUNDING_OF_FUNDS = 1e-9  # relative: a budget may be exceeded by the rounding of a sum


@dataclass(frozen=True, eq=False)
class Day:
    """Costs of visits and of load changes, and the budget.

    A plan with s loads, none counted as one, needs s - 1 load changes; of several loads the study
    may ask for more. Where experiments are pairs, each under a load visits its pose without it,
    too.

    Attributes:
        visit: Cost of a visit without a load.
        loaded_visit: Cost of a visit under a load.
        change: Cost of a load change.
        changes: Changes of a plan with several loads; None for the least number.
        budget: What the new visits may cost together.
        visits: Number of new experiments; None where the budget decides.
        paired: Whether experiments are pairs of visits.
    """

    visit: float
    loaded_visit: float
    change: float
    changes: int | None
    budget: float
    visits: int | None
    paired: bool = False

    @classmethod
    def from_dict(cls, content: Any) -> "Day":
        """Read the part `day` of a certificate.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        content = table(content, KEYS, "day", ("paired",))
        paired = content.get("paired", False)
        if not isinstance(paired, bool):
            raise ValueError("day.paired: expected true or false")
        costs = {name: number(content[name], f"day.{name}") for name in (*KEYS[:3], "budget")}
        if min(costs["visit"], costs["loaded_visit"]) <= 0 or costs["load_change"] < 0:
            raise ValueError("day: expected costs above zero, and of load changes none below it")
        changes, visits = content["load_changes"], content["visits"]
        return cls(
            costs["visit"],
            costs["loaded_visit"],
            costs["load_change"],
            None if changes is None else whole(changes, 0, MOST_CHANGES, "day.load_changes"),
            costs["budget"],
            None if visits is None else whole(visits, 1, MOST_VISITS, "day.visits"),
            paired,
        )

    def price(self, wrench: Array) -> Array:
        """Costs (k,) of an experiment under each of some wrenches (k, 6)."""
        loaded = self.loaded_visit + (self.visit if self.paired else 0.0)
        return np.where(np.any(wrench != 0, axis=1), loaded, self.visit)

    def total(self, wrench: Array, amount: Array) -> float:
        """What experiments cost under some wrenches (k, 6), load changes included."""
        return float(self.price(wrench) @ amount + self.change * self._changes_of(wrench))

    def sets(self, wrenches: Array) -> Iterator[tuple[tuple[int, ...], float]]:
        """All sets of the loads (s, 6) that the budget pays for, with what is left for visits.

        Raises:
            ValueError: They are too many.
        """
        if len(wrenches) > MOST_LOADS:
            raise ValueError(f"day: expected at most {MOST_LOADS} loads, got {len(wrenches)}")
        prices = self.price(wrenches)
        for count in range(1, len(wrenches) + 1):
            for loads in combinations(range(len(wrenches)), count):
                funds = self.budget - self.change * self._changes_of(wrenches[list(loads)])
                least = prices[list(loads)].min() * (self.visits or 1)
                if funds * (1 + ROUNDING_OF_FUNDS) >= least:
                    yield loads, funds

    def amount(self, prices: Array, funds: float) -> tuple[float, bool]:
        """The amount that bounds all plans of some loads, and whether it is one of costs.

        Visits are counted where their number is given, or where all cost the same.
        """
        if self.visits is not None:
            return float(self.visits), False
        if (prices == prices[0]).all():
            return float(np.floor(funds * (1 + ROUNDING_OF_FUNDS) / prices[0])), False
        return funds, True

    def _changes_of(self, wrench: Array) -> int:
        """Load changes of a plan under some wrenches (k, 6)."""
        kinds = {tuple(row) for row in wrench.tolist()}
        if self.paired and any(map(any, kinds)):
            kinds.add((0.0,) * wrench.shape[1])
        least = len(kinds) - 1
        return least if least < 1 or self.changes is None else max(self.changes, least)
