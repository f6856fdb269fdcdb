"""A plan of visits for a study of geometry: which poses to measure, without and with a load."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from edtk.calibration.geometry_design.day_costs import DayCosts
from edtk.calibration.geometry_design.geometry_question import GeometryQuestion
from edtk.calibration.geometry_design.poses_by_load import PosesByLoad
from edtk.design.bound import Bound
from edtk.design.exact.exact_plan import ExactPlan
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.system.typing import Array, Indices


@dataclass(frozen=True, eq=False, kw_only=True)
class GeometryPlan(ExactPlan):
    """The best plan of visits that a search has found.

    Attributes:
        question: The question of the study.
        bound_of_all: No plan within the same size and budget costs less, whatever loads it uses.
        costs: What visits and load changes cost; None where nobody said.
        tried: Loads that a plan within the budget may visit, as indices of `question.wrenches`,
            with the cost of the best plan of them; none where nothing limits the loads.
        asked: Number of new visits that were asked for; None where the budget decides.
        proofs: The relaxations of all sets of loads that the budget pays for, on which the bound
            rests; none of a set that cannot tell what the criterion needs.
        rho0: Error of the markers to expect in the test poses [m]; None without any.
    """

    question: GeometryQuestion
    bound_of_all: Bound
    costs: DayCosts | None = None
    tried: dict[tuple[int, ...], float] = field(default_factory=dict)
    rho0: float | None = None
    asked: int | None = None
    proofs: dict[tuple[int, ...], RelaxedPlan] = field(default_factory=dict)

    @property
    def lower_bound(self) -> Bound:
        """The bound on the cost of every plan within the same size and budget."""
        return self.bound_of_all

    @property
    def bound_gap(self) -> float:
        """Relative gap between the bound and the best weights."""
        return self.bound_of_all.gap

    @property
    def poses(self) -> PosesByLoad:
        """The poses, each once, with its visits without and with each load; kept ones too."""
        return PosesByLoad.of(self.whole, self.question.wrenches, self.robot)

    @property
    def listed(self) -> Array:
        """The poses (k, n) in the order in which they are printed [rad or m]."""
        return self.poses.q

    @property
    def poses_kept(self) -> Indices:
        """How many of the visits of each of these poses were made already (k,)."""
        every = self.poses.visits.sum(axis=1)
        if self.kept is None:
            return np.zeros(len(every), dtype=int)
        return self.poses.visits_of(self.kept)

    @property
    def spent(self) -> float | None:
        """What the new visits cost, load changes included; None where nobody said."""
        if self.costs is None:
            return None
        new = PosesByLoad.of(self.plan, self.question.wrenches, self.robot)
        return self.costs.total(new.wrenches, new.visits.sum(axis=0))

    @property
    def day(self) -> dict[str, Any] | None:
        """What visits cost and may cost, as a certificate holds it; None without a budget."""
        costs = self.costs
        if costs is None or costs.budget is None:
            return None
        return {
            "visit": costs.visit,
            "loaded_visit": costs.loaded_visit,
            "load_change": costs.change,
            "load_changes": costs.changes,
            "budget": costs.budget,
            "visits": self.asked,
        }

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, as of other plans, with costs, loads and what is identified."""
        found = super().to_dict()
        poses = self.poses
        new = PosesByLoad.of(self.plan, self.question.wrenches, self.robot)
        loads = int(np.count_nonzero(new.visits.sum(axis=0)))
        costs = self.costs
        return {
            **found,
            "rank": self.question.model.p,
            "structural_rank": self.question.structural.p,
            "parameters": [one.name for one in self.question.model.parameters],
            "untold": list(self.question.untold),
            "rho0_mm": None if self.rho0 is None else 1e3 * self.rho0,
            "loads": poses.wrenches.tolist(),
            "poses": poses.to_list(),
            "costs": None
            if costs is None
            else {
                "spent": self.spent,
                "budget": costs.budget,
                "load_changes": costs.changes_of(loads),
                "unit": costs.unit,
            },
        }
