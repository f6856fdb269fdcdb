"""The best plan of one set of loads."""

from dataclasses import dataclass

from edtk.calibration.geometry_design.day_costs import DayCosts
from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.calibration.geometry_design.poses_by_load import PosesByLoad
from edtk.calibration.geometry_design.visit_search import FoundVisits
from edtk.design.bound import Bound
from edtk.design.relaxation.relaxed_plan import RelaxedPlan


@dataclass(frozen=True, eq=False)
class LoadTrial:
    """The best plan of one set of loads.

    Attributes:
        loads: Indices of the loads.
        relaxed: The relaxation over its poses.
        total: Visits, or what they cost, of which the relaxation has one.
        found: The plan; None where it could not be better than another one.
    """

    loads: tuple[int, ...]
    relaxed: RelaxedPlan
    total: float
    found: FoundVisits | None

    @property
    def bound(self) -> Bound:
        """No plan of these loads costs less."""
        return self.relaxed.best_bound.scaled(self.total)

    @classmethod
    def of(
        cls,
        loads: tuple[int, ...],
        relaxed: RelaxedPlan,
        total: float,
        found: FoundVisits | None,
    ) -> "LoadTrial":
        """A trial whose bound holds for the plan that was found."""
        if found is not None and relaxed.searched_bound is None:
            relaxed = relaxed.holding_for(found.x)
        return cls(loads, relaxed, total, found)

    def or_better(self, earlier: "LoadTrial | None") -> "LoadTrial":
        """The trial with the plan of an earlier one, where that is better or the only one."""
        if earlier is None or earlier.found is None:
            return self
        if self.found is not None and self.found.cost <= earlier.found.cost:
            return self
        return LoadTrial.of(self.loads, self.relaxed, self.total, earlier.found)

    def price(self, question: GeometryQuestion, costs: DayCosts) -> float:
        """What the day of the plan costs."""
        assert self.found is not None
        visits = self.relaxed.space.plan(self.found.x, self.found.repeats)
        poses = PosesByLoad.of(visits, question.wrenches, question.study.robot)
        return costs.total(poses.wrenches, poses.visits.sum(axis=0))
