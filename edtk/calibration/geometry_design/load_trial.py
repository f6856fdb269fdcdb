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
        bound: No plan of these loads costs less.
        found: The plan; None where it could not be better than another one.
    """

    loads: tuple[int, ...]
    relaxed: RelaxedPlan
    bound: Bound
    found: FoundVisits | None

    def price(self, question: GeometryQuestion, costs: DayCosts) -> float:
        """What the day of the plan costs."""
        assert self.found is not None
        visits = self.relaxed.space.plan(self.found.x, self.found.repeats)
        poses = PosesByLoad.of(visits, question.wrenches, question.study.robot)
        return costs.total(poses.wrenches, poses.visits.sum(axis=0))
