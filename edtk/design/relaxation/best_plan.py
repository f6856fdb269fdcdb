"""The best certified plan of a run so far, with the time that the run has taken."""

from time import perf_counter

from criteria import Relaxable
from edtk.design.bound import Bound, BoundKind
from edtk.design.candidate_source import CandidateSource
from edtk.design.relaxation.active_set import ActiveSet
from edtk.design.relaxation.largest_sensitivities import LargestSensitivities
from edtk.design.relaxation.relaxed_plan import RelaxedPlan


class BestPlan:
    """A run can be interrupted at any time and then leaves this plan.

    Args:
        source: Where the candidates come from.
        criterion: What is minimised.

    Attributes:
        plan: The best certified plan, or None before there is one.
    """

    def __init__(self, source: CandidateSource, criterion: Relaxable) -> None:
        self.source = source
        self.criterion = criterion
        self.plan: RelaxedPlan | None = None
        self._seconds = {"candidates": 0.0, "solve": 0.0, "continuous": 0.0}
        self._since = perf_counter()

    def spend(self, stage: str) -> None:
        """Add the time since the last call to a stage."""
        now = perf_counter()
        spent = self._seconds[stage] + now - self._since
        self._seconds = self._seconds | {stage: spent}
        self._since = now

    def certify(
        self,
        active: ActiveSet,
        candidates: int,
        proved: LargestSensitivities,
        searched: LargestSensitivities | None = None,
        design: ActiveSet | None = None,
    ) -> RelaxedPlan:
        """Make the plan of an active set, with the bounds that its multipliers prove.

        Args:
            active: Gives the multipliers, and the design if no other is given.
            candidates: Number of candidates among which sensitivities are the largest.
            proved: Their largest sensitivities.
            searched: The largest sensitivities that a search over all poses has found.
            design: The design, where it rests on fewer poses than the active set.
        """
        Z = active.relaxation.multipliers
        design = design or active
        support = design.support
        M = support.problem.information(design.weights)
        cost = float(self.criterion.cost(M))
        # The bound has to hold for this design, too, whose poses may not be candidates.
        proved = proved.or_larger(LargestSensitivities.over(support, self.criterion, Z))
        searched = None if searched is None else searched.or_larger(proved)
        self.plan = RelaxedPlan(
            source=self.source,
            candidates=candidates,
            criterion=self.criterion,
            x=support.x,
            weights=design.weights,
            cost=cost,
            proved_bound=Bound.of(
                self.criterion,
                self.criterion.lower_bound(Z, proved.values, M),
                cost,
                BoundKind.PROVED_ON_CANDIDATES,
            ),
            searched_bound=None
            if searched is None
            else Bound.of(
                self.criterion,
                self.criterion.lower_bound(Z, searched.values, M),
                cost,
                BoundKind.SEARCHED,
            ),
            multipliers=Z,
            proved_sensitivities=proved,
            searched_sensitivities=searched,
            solver=design.relaxation.solver,
            iterations=active.iterations,
            seconds=self._seconds,
        )
        return self.plan
