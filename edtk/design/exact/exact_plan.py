"""A plan of whole experiments with what it is worth, and how far it is from the bound."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from edtk.design.bound import Bound, BoundKind, printed_form
from edtk.design.plan import Plan
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.system.presented import Presented
from edtk.tables.pose_table import pose_factors

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ExactPlan(Presented):
    """The best plan of m experiments that a search has found.

    Attributes:
        relaxed: The relaxation that the search started from, with its bound.
        plan: Poses, wrenches and repetitions of the new experiments.
        kept: Experiments that are there already; None for none.
        cost: The criterion's cost of all experiments together.
        starts: Number of descents.
        found: How many of the plans that were refined to the end came out as this one.
        optima: How many different plans they came out as.
        seconds: How long it took [s].
        ended: Why it ended: "stagnation", "starts", "budget" or "interrupted".
    """

    relaxed: RelaxedPlan
    plan: Plan
    kept: Plan | None
    cost: float
    starts: int
    found: int
    optima: int
    seconds: float
    ended: str

    def headline(self) -> str:
        """Criterion, value, size and efficiency."""
        factor, unit = self.relaxed.criterion.shown
        value = f"{factor * self.value:.4g} {unit}".rstrip()
        return (
            f"{self.relaxed.criterion.name} = {value} with {self.whole.experiments} experiments, "
            f"efficiency {100 * self.efficiency:.2f} %"
        )

    @property
    def whole(self) -> Plan:
        """All experiments, those that are there already first."""
        return self.plan if self.kept is None else self.kept + self.plan

    @property
    def value(self) -> float:
        """The criterion as printed in its formula."""
        return printed_form(self.cost, self.relaxed.criterion.sense)

    @property
    def lower_bound(self) -> Bound:
        """The bound on the cost of every plan of so many new experiments."""
        return self.relaxed.best_bound.scaled(self.plan.experiments)

    @property
    def bound(self) -> float:
        """That bound in the criterion's printed form."""
        return self.lower_bound.value

    @property
    def bound_gap(self) -> float:
        """How far the bound may still be below the best weights; large only if its search was cut off."""
        return self.relaxed.best_bound.gap

    @property
    def efficiency(self) -> float:
        """``bound / cost`` as costs: one for a plan that cannot be improved."""
        return self.lower_bound.efficiency(self.cost)

    @property
    def violation(self) -> float:
        """By how much the worst of the new poses violates a constraint [m or rad]; zero for none."""
        return float(max(0.0, -self.relaxed.space.workspace.slack(self.plan.q).min()))

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, for JSON."""
        robot, bound = self.relaxed.space.workspace.robot, self.bound
        rows = []
        for plan, kept in ((self.kept, True), (self.plan, False)):
            if plan is not None:
                rows += [
                    {"q_deg": q.tolist(), "repeats": int(r), "wrench": W.tolist(), "kept": kept}
                    for q, r, W in zip(
                        plan.q / pose_factors(robot), plan.repeats, plan.wrench, strict=True
                    )
                ]
        return {
            "criterion": self.relaxed.criterion.name,
            "experiments": self.whole.experiments,
            "value": self.value,
            "bound": bound if np.isfinite(bound) else None,
            "bound_searched": self.lower_bound.kind is BoundKind.SEARCHED,
            "bound_gap": self.bound_gap if np.isfinite(self.bound_gap) else None,
            "efficiency": self.efficiency,
            "starts": self.starts,
            "found": self.found,
            "optima": self.optima,
            "ended": self.ended,
            "seconds": self.seconds,
            "constraint_violation": self.violation,
            "plan": rows,
        }
