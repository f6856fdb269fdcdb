"""What visits of a day cost and what its budget leaves; the poses of a plan by load."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from edtk.design.plan import Plan
from edtk.measure.pose_table import in_file_units
from edtk.robots.robot import Robot
from edtk.study.study import Study
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array, Indices

MOST_VISITS = 500
ROUNDING = 1e-9  # relative: a budget may be exceeded by the rounding of a sum
DIGITS = 9  # of joint variables: rounding must not make two poses of one


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


@dataclass(frozen=True, eq=False)
class PosesByLoad:
    """Poses and how often each is visited under each load.

    Attributes:
        q: Joint variables (k, n) [rad or m].
        visits: Number of visits (k, s).
        wrenches: The loads (s, 6), none first [N, N m].
        robot: The robot, which says the units of the joints.
    """

    q: Array
    visits: Indices
    wrenches: Array
    robot: Robot

    @classmethod
    def of(cls, plan: Plan, wrenches: Array, robot: Robot) -> "PosesByLoad":
        """The poses of a plan: without a load first, then both, then loaded alone.

        Args:
            plan: The plan.
            wrenches: Loads that come first (s, 6); others of the plan follow.
            robot: The robot.
        """
        every = np.concatenate([wrenches, plan.wrench])
        first = np.sort(np.unique(every, axis=0, return_index=True)[1])
        loads = every[first]
        which = np.array([int(np.flatnonzero((loads == W).all(axis=1))[0]) for W in plan.wrench])
        _, start, pose = np.unique(
            np.round(plan.q, DIGITS) + 0.0, axis=0, return_index=True, return_inverse=True
        )
        visits = np.zeros((len(start), len(loads)), dtype=int)
        np.add.at(visits, (pose.reshape(-1), which), plan.repeats)
        kind = np.where(visits[:, 0] == 0, 2, (visits[:, 1:].any(axis=1)).astype(int))
        order = np.lexsort((start, kind))
        return cls(plan.q[start][order], visits[order], loads, robot)

    def visits_of(self, plan: Plan) -> Indices:
        """How many of the visits of each pose (k,) are those of a part of the plan."""
        same = (np.abs(plan.q[:, None] - self.q) <= 10.0**-DIGITS).all(axis=-1)
        return np.asarray((same * plan.repeats[:, None]).sum(axis=0))

    def to_list(self) -> list[dict[str, Any]]:
        """Plain numbers: each pose as files have it [deg, mm], and its visits by load."""
        shown = in_file_units(self.robot, self.q)
        return [
            {
                "q_deg": q.tolist(),
                "unloaded": int(own[0]),
                "loaded": int(own[1:].sum()),
                "visits": own.tolist(),
            }
            for q, own in zip(shown, self.visits, strict=True)
        ]
