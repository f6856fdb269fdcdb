"""What a plan of visits costs, load changes included."""

from dataclasses import dataclass

import numpy as np

from edtk.study.study import Study
from edtk.system.typing import Array, Indices


@dataclass(frozen=True)
class DayCosts:
    """Costs of a day: ``sum of visits * their cost + load changes * cost of a change``.

    The poses of one load are visited together, so that a plan with s loads, none counted as one,
    needs s - 1 changes: that with which the day begins is mounted beforehand. Where drift asks for
    more, the study says how many.

    Attributes:
        visit: Cost of a visit without a load.
        loaded_visit: Cost of a visit under a load.
        change: Cost of a load change.
        changes: Changes of a plan with several loads; None for the least number.
        budget: What a plan may cost; None for any.
        unit: What costs are counted in; may be empty.
    """

    visit: float = 1.0
    loaded_visit: float = 1.0
    change: float = 0.0
    changes: int | None = None
    budget: float | None = None
    unit: str = ""

    @classmethod
    def of(cls, study: Study, budget: float | None = None) -> "DayCosts | None":
        """Those of a study; None where neither it nor the call says any.

        Args:
            study: The study.
            budget: What a plan may cost, in place of the study's own.
        """
        given = study.specification.costs
        if given is None:
            return None if budget is None else cls(budget=budget)
        return cls(
            given.visit,
            given.visit if given.loaded_visit is None else given.loaded_visit,
            given.load_change,
            given.load_changes,
            given.budget if budget is None else budget,
            given.unit,
        )

    def prices(self, wrenches: Array) -> Array:
        """Costs (s,) of a visit under each wrench (s, 6)."""
        return np.where(wrenches.any(axis=1), self.loaded_visit, self.visit)

    def changes_of(self, loads: int) -> int:
        """Load changes of a plan that visits poses under so many loads, none counted as one."""
        least = loads - 1
        if loads < 2 or self.changes is None:
            return least
        return max(self.changes, least)

    def total(self, wrenches: Array, visits: Indices) -> float:
        """What a plan costs with so many visits (s,) under each wrench (s, 6)."""
        loads = int(np.count_nonzero(visits))
        return float(self.prices(wrenches) @ visits + self.change * self.changes_of(loads))
