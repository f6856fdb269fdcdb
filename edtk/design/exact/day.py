"""What a day costs and what its budget leaves, a plan for it, and its poses by load."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np

from edtk.design.bound import Bound
from edtk.design.exact.exact_plan import ExactPlan
from edtk.design.plan import Plan
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.measure.pose_table import in_file_units
from edtk.robots.frames import all_wrenches
from edtk.robots.robot import Robot
from edtk.system.errors import ArgumentError
from edtk.system.typing import Array, Indices

MOST_LOADS = 5  # none not counted: of more, too many sets would have to be searched one by one
MOST_VISITS = 500
ROUNDING_OF_BUDGET = 1e-9  # relative: a budget may be exceeded by the rounding of a sum
POSE_DIGITS = 9  # of joint variables: rounding must not make two poses of one


@dataclass(frozen=True)
class DayCosts:
    """Costs of a day: ``sum of visits * their cost + load changes * cost of a change``.

    The poses of one load are visited together, so that a plan with s loads, none counted as one,
    needs s - 1 changes: that with which the day begins is mounted beforehand. Where drift asks for
    more, the study says how many. An experiment that measures how far a load moves the robot visits
    its pose twice, without the load and with it.

    Attributes:
        visit: Cost of a visit without a load.
        loaded_visit: Cost of a visit under a load.
        change: Cost of a load change.
        changes: Changes of a plan with several loads; None for the least number.
        budget: What a plan may cost; None for any.
        unit: What costs are counted in; may be empty.
        paired: Whether each experiment needs a visit of its pose without the load, too.
    """

    visit: float = 1.0
    loaded_visit: float = 1.0
    change: float = 0.0
    changes: int | None = None
    budget: float | None = None
    unit: str = ""
    paired: bool = False

    def prices(self, wrenches: Array) -> Array:
        """Costs (s,) of an experiment under each wrench (s, 6)."""
        beside = self.visit if self.paired else 0.0
        return np.where(wrenches.any(axis=1), beside + self.loaded_visit, self.visit)

    def changes_of(self, wrenches: Array) -> int:
        """Load changes of a plan under some wrenches (k, 6), as often as they occur.

        Where experiments are pairs, none comes on top of their loads.
        """
        loads = np.unique(wrenches, axis=0)
        loaded = int(loads.any(axis=1).sum())
        unloaded = loaded < len(loads) or (self.paired and loaded > 0)
        least = loaded + unloaded - 1
        if least < 1 or self.changes is None:
            return least
        return max(self.changes, least)

    def total(self, wrenches: Array, visits: Indices) -> float:
        """What a plan costs with so many experiments (s,) under each wrench (s, 6)."""
        changes = self.changes_of(wrenches[visits > 0])
        return float(self.prices(wrenches) @ visits + self.change * changes)

    def spent(self, plan: Plan) -> float:
        """What a plan costs."""
        return self.total(plan.wrench, plan.repeats)

    def to_dict(self, visits: int | None) -> dict[str, Any] | None:
        """What a certificate says of a day with so many new experiments; None without a budget."""
        if self.budget is None:
            return None
        return {
            "visit": self.visit,
            "loaded_visit": self.loaded_visit,
            "load_change": self.change,
            "load_changes": self.changes,
            "budget": self.budget,
            "visits": visits,
            **({"paired": True} if self.paired else {}),
        }


@dataclass(frozen=True, eq=False)
class DayBudget:
    """The sets of loads that a day can pay for, and how many visits of each.

    Attributes:
        wrenches: The loads (s, 6) to choose from, none counted as one [N, N m]. None where every
            experiment chooses its own: they are one set then, and no load is changed.
        new: Number of new visits; None where the budget decides.
        costs: What visits and load changes cost; None where nothing is said of costs.
    """

    wrenches: Array | None
    new: int | None
    costs: DayCosts | None

    def prices(self, loads: tuple[int, ...]) -> Array:
        """Costs of a visit under each of some loads."""
        if self.costs is None:
            return np.ones(max(1, len(loads)))
        if self.wrenches is None:
            return self.costs.prices(np.ones((1, 6)))
        return self.costs.prices(self.wrenches)[list(loads)]

    def sets(self) -> Iterator[tuple[tuple[int, ...], float]]:
        """Sets of loads, and what the budget leaves for visits; infinite without a budget.

        Raises:
            ArgumentError: The budget pays for no plan.
        """
        every = () if self.wrenches is None else tuple(range(len(self.wrenches)))
        if self.costs is None or self.costs.budget is None:
            yield every, np.inf
            return
        any_left = False
        # Large sets first: their plans are the best ones where load changes are cheap.
        for number in range(len(every), 0, -1) if every else (0,):
            for loads in combinations(every, number):
                funds = self.costs.budget - self._for_changes(loads)
                if affords(funds, self._least(loads)):
                    any_left = True
                    yield loads, funds
        if not any_left:
            what = "experiment" if self.costs.paired else "visit"
            visits = f"a{'n' * self.costs.paired} {what} costs"
            if self.new is not None:
                visits = f"{self.new} {what}s cost"
            singles: list[tuple[int, ...]] = [(i,) for i in every] or [()]
            least = min(self._least(one) + self._for_changes(one) for one in singles)
            message = f"{visits} {least:g} or more"
            raise ArgumentError(message, argument="cost_budget", given=self.costs.budget)

    def _for_changes(self, loads: tuple[int, ...]) -> float:
        """What the changes of some loads cost."""
        if self.costs is None or self.wrenches is None:
            return 0.0
        return self.costs.change * self.costs.changes_of(self.wrenches[list(loads)])

    def _least(self, loads: tuple[int, ...]) -> float:
        """What the cheapest plan of some loads costs, load changes not counted."""
        return float(self.prices(loads).min()) * (self.new or 1)

    def most(self) -> int:
        """The largest number of new experiments.

        Raises:
            ArgumentError: The budget pays for none, or for too many.
        """
        return max(
            self.new or most_visits(funds, float(self.prices(loads).min()))
            for loads, funds in self.sets()
        )


def affords(funds: float, price: float) -> bool:
    """Whether some funds pay a price."""
    return funds * (1 + ROUNDING_OF_BUDGET) >= price


def most_visits(funds: float, price: float) -> int:
    """How many visits of a price some funds pay for.

    Raises:
        ArgumentError: They are too many for a search.
    """
    number = int(np.floor(funds * (1 + ROUNDING_OF_BUDGET) / price))
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
        every = all_wrenches(wrenches, plan.wrench)
        first = np.sort(np.unique(every, axis=0, return_index=True)[1])
        loads = every[first]
        which = np.array(
            [int(np.flatnonzero((loads == W).all(axis=1))[0]) for W in every[len(wrenches) :]]
        )
        _, start, pose = np.unique(
            np.round(plan.q, POSE_DIGITS) + 0.0, axis=0, return_index=True, return_inverse=True
        )
        visits = np.zeros((len(start), len(loads)), dtype=int)
        np.add.at(visits, (pose.reshape(-1), which), plan.repeats)
        kind = np.where(visits[:, 0] == 0, 2, (visits[:, 1:].any(axis=1)).astype(int))
        order = np.lexsort((start, kind))
        return cls(plan.q[start][order], visits[order], loads, robot)

    def visits_of(self, plan: Plan) -> Indices:
        """How many of the visits of each pose (k,) are those of a part of the plan."""
        same = (np.abs(plan.q[:, None] - self.q) <= 10.0**-POSE_DIGITS).all(axis=-1)
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


@dataclass(frozen=True, eq=False, kw_only=True)
class DayPlan(ExactPlan):
    """The best plan for a day whose visits and load changes cost something.

    Attributes:
        bound_of_all: No plan within the same size and budget costs less, whatever loads it uses.
        wrenches: The loads (s, 6) to choose from, none counted as one [N, N m]; None where every
            experiment chooses its own.
        costs: What visits and load changes cost; None where nobody said.
        tried: Loads that a plan within the budget may visit, as indices of `wrenches`, with the
            cost of the best plan of them; none where nothing limits the loads.
        asked: Number of new experiments that were asked for; None where the budget decides.
        proofs: The relaxations of all sets of loads that the budget pays for, on which the bound
            rests; none of a set that cannot tell what the criterion needs.
        bound_without_cell: The same bound over all poses, free or not; None without a cell.
    """

    bound_of_all: Bound
    wrenches: Array | None = None
    costs: DayCosts | None = None
    tried: dict[tuple[int, ...], float] = field(default_factory=dict)
    asked: int | None = None
    proofs: dict[tuple[int, ...], RelaxedPlan] = field(default_factory=dict)
    bound_without_cell: Bound | None = None

    @property
    def certified(self) -> "DayPlan":
        """The plan with the bound over all poses, see `ExactPlan.certified`."""
        if self.bound_without_cell is None:
            return self
        return replace(
            self,
            relaxed=self.relaxed.certified,
            on_candidates=None,
            bound_of_all=self.bound_without_cell,
            bound_without_cell=None,
            proofs={loads: one.certified for loads, one in self.proofs.items()},
        )

    def beside(self, relaxed: RelaxedPlan) -> "DayPlan":
        """The same plan, with another relaxation of the same question and its bound."""
        bound, beyond = (
            one.best_bound.scaled(self.plan.experiments) for one in (relaxed, relaxed.certified)
        )
        return replace(
            self,
            relaxed=relaxed,
            bound_of_all=bound,
            bound_without_cell=None if relaxed.without_cell is None else beyond,
        )

    @property
    def lower_bound(self) -> Bound:
        """The bound on the cost of every plan within the same size and budget."""
        return self.bound_of_all

    @property
    def bound_gap(self) -> float:
        """Relative gap between the bound and the best weights."""
        return self.bound_of_all.gap

    @property
    def shows_loads(self) -> bool:
        """Whether experiments may differ in their loads."""
        return super().shows_loads or (self.wrenches is not None and len(self.wrenches) > 1)

    @property
    def spent(self) -> float | None:
        """What the new experiments cost, load changes included; None where nobody said."""
        return None if self.costs is None else self.costs.spent(self.plan)

    @property
    def day(self) -> dict[str, Any] | None:
        """What visits cost and may cost, as a certificate holds it; None without a budget.

        Where every experiment chooses its own load, a certificate holds the size alone.
        """
        if self.costs is None or self.wrenches is None:
            return None
        return self.costs.to_dict(self.asked)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, as of other plans, with what the day costs where somebody said."""
        costs = self.costs
        if costs is None:
            return super().to_dict()
        return {
            **super().to_dict(),
            "costs": {
                "spent": self.spent,
                "budget": costs.budget,
                "load_changes": costs.changes_of(self.plan.wrench),
                "unit": costs.unit,
            },
        }
