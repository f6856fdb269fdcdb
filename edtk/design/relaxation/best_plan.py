"""The best certified plan of a run so far, with the time that the run has taken."""

from time import perf_counter

from criteria import Relaxable
from edtk.design.bound import Bound, BoundKind
from edtk.design.candidate_source import CandidateSource
from edtk.design.relaxation.active_set import ActiveSet
from edtk.design.relaxation.largest_sensitivities import LargestSensitivities
from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.system.typing import Array


class BestPlan:
    """The result of a run when it ends or is interrupted.

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
            active: The active set; its design is the plan's unless another one is given.
            candidates: Number of candidates.
            proved: The largest sensitivities of these candidates.
            searched: The largest sensitivities that a search has found.
            design: A design on fewer poses.
        """
        Z = active.relaxation.multipliers
        design = design or active
        support = design.support
        M = support.problem.information(design.weights)
        # The bound has to hold for this design, too, whose poses may not be candidates.
        proved = proved.or_larger(LargestSensitivities.over(support, self.criterion, Z))
        searched = None if searched is None else searched.or_larger(proved)
        proved_bound, searched_bound = self._bounds(M, Z, proved, searched)
        self.plan = RelaxedPlan(
            source=self.source,
            candidates=candidates,
            criterion=self.criterion,
            x=support.x,
            weights=design.weights,
            cost=float(self.criterion.cost(M)),
            proved_bound=proved_bound,
            searched_bound=searched_bound,
            multipliers=Z,
            proved_sensitivities=proved,
            searched_sensitivities=searched,
            solver=design.relaxation.solver,
            iterations=active.iterations,
            seconds=self._seconds,
        )
        return self.plan

    def _bounds(
        self,
        M: Array,
        multipliers: Array,
        proved: LargestSensitivities,
        searched: LargestSensitivities | None,
    ) -> tuple[Bound, Bound | None]:
        """The bounds that multipliers (r, p, p) prove near a design M (p, p)."""

        def bound(largest: LargestSensitivities, kind: BoundKind) -> Bound:
            cost = self.criterion.lower_bound(multipliers, largest.values, M)
            return Bound.of(self.criterion, cost, float(self.criterion.cost(M)), kind)

        on_candidates = bound(proved, BoundKind.PROVED_ON_CANDIDATES)
        return on_candidates, None if searched is None else bound(searched, BoundKind.SEARCHED)
