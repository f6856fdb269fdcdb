"""The relaxation over a region: weights on a grid, then on the points that ascents find."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from criteria import Criterion, Relaxable
from criteria.linalg.inverse import eigenpairs
from edtk.design.bound import BLURRED, Bound, BoundKind
from edtk.design.candidate_source import Candidates
from edtk.design.problem import RankDeficientError
from edtk.design.region import Region
from edtk.design.relaxation.proof import normalised
from edtk.design.relaxation.relax import relax
from edtk.design.relaxation.relax_poses import ActiveSet
from edtk.design.relaxation.relaxed_region import JudgedRegion, RelaxedRegion
from edtk.design.relaxation.restricted_master import SolverOptions
from edtk.design.relaxation.search_continuum import LargestSensitivities
from edtk.design.relaxation.search_region import (
    MARGIN_OF_ASCENT,
    POINTS,
    RegionGrid,
    grouped,
    on_few,
    polish,
    search_region,
    with_cost,
)
from edtk.system.typing import Array, Mask

REGION_GAP = 1e-7
FIRST_POINTS = 600  # points of the first relaxation: it only has to find out where to look closer
REGION_ROUNDS = 30  # searches at most; four or five are the rule
SAME_POINT = 1e-9  # parts of a range up to which two points are one
NO_LOWER = 1e-12  # relative: a cost that is lower by less is the same but for rounding
FAST = 0.3  # part to which a round should shrink the gap
NEAR_POINTS = 60  # points of the grid per multiplier
ROUNDS_TO_SHRINK = 8  # rounds that must together shrink the gap to this part
SHRUNK_TO = 0.7
NEXT_GAP = 0.05  # gap of the next relaxation, in parts of the present one


# A look beyond the search: made for region and criterion as they are judged, it is asked with the
# search and its relaxation whether that is the end. It may know more points by then.
Closing = Callable[[JudgedRegion], Callable[["RegionSearch", ActiveSet], bool]]


def relax_region(
    region: Region,
    criterion: Criterion,
    candidates: int = POINTS,
    gap: float = REGION_GAP,
    progress: Callable[[str, float], object] = lambda stage, gap: None,
    closing: Closing | None = None,
) -> RelaxedRegion:
    """Find the best weights over all points of a region, with a bound on every design.

    The first relaxation is over a coarse grid. Then, round after round, ascents from all local
    maxima on a finer grid find the points of largest sensitivity, which join the design's points,
    until the bound that they leave is close enough (the exchange of Wynn and Fedorov, with several
    points at a time and a whole relaxation in place of a step). Each design is polished: close
    points merge, and points and weights move together.

    Args:
        region: The region.
        criterion: A criterion that can be relaxed.
        candidates: Number of points of the grid, about.
        gap: Relative gap between cost and bound at which to stop. The gap of the result may be
            larger.
        progress: Called with the stage and its relative gap.
        closing: What is asked before the end, see `Closing`; by default nothing.

    Raises:
        NotImplementedError: The criterion cannot be relaxed.
        RankDeficientError: The region cannot identify all parameters.
        RelaxationError: No solver found a design.
        UserError: No point is feasible, or the model fails.
    """
    judged, first = _first_grid(region, criterion, candidates)
    relaxation = relax(first.problem, judged.criterion, options=SolverOptions(few=False))
    progress("grid", relaxation.gap)
    active = ActiveSet(Candidates(first.x, first.problem), relaxation, relaxation.iterations)
    grid = RegionGrid.of(judged.region, candidates)
    search = RegionSearch(grid, judged.criterion, closing is None)
    ends = (lambda search, active: True) if closing is None else closing(judged)
    for turn in range(REGION_ROUNDS):
        away = search.after(active, gap)
        progress("region", away)
        if (away <= gap or search.stuck(turn)) and ends(search, active):
            break
        around = np.concatenate(
            [search.points, active.support.x, search.found, search.near(active)]
        )
        active = active.over(_apart(judged.region, around), max(0.3 * gap, NEXT_GAP * away))
    return replace(search.result(active, judged), region=region, criterion=criterion)


def _first_grid(
    region: Region, criterion: Criterion, candidates: int
) -> tuple[JudgedRegion, RegionGrid]:
    """The region as it is judged, and the points of the first relaxation."""
    x = RegionGrid.of(region, min(candidates, FIRST_POINTS)).x
    try:
        judged = JudgedRegion.of(region, criterion, x)
    except RankDeficientError:
        # Narrow places that tell a parameter may lie between the points of the coarse grid.
        x = RegionGrid.of(region, candidates).x
        judged = JudgedRegion.of(region, criterion, x)
    return judged, RegionGrid(judged.region, x)


class RegionSearch:
    """The best design and the best proof so far; they may come from different rounds.

    Args:
        grid: Where ascents begin.
        criterion: What is minimised.
        alone: Whether nobody looks beyond the search: then points and weights of each design are
            polished, and the largest sensitivities are raised by a margin.
    """

    def __init__(self, grid: RegionGrid, criterion: Relaxable, alone: bool = True) -> None:
        self.grid = grid
        self.criterion = criterion
        self.alone = alone
        self.points = np.empty((0, grid.region.size))
        self.weights = np.empty(0)
        self.cost = np.inf
        self.proof: RegionProof | None = None
        self.is_refuted = False
        self.found = self.points
        self._gaps: list[float] = []

    @property
    def gap(self) -> float:
        """Relative gap between the best design and the best bound."""
        return 1.0 if self.proof is None else 1 - self.proof.cost / self.cost

    def after(self, active: ActiveSet, enough: float) -> float:
        """Take over what is better of a relaxation, and search the region with its multipliers.

        Args:
            active: The relaxation.
            enough: The gap that is asked for.

        Returns:
            The gap that remains.
        """
        support = active.support.x
        design = polish if self.alone else with_cost
        x, weights, cost = design(self.grid.region, self.criterion, support, active.weights)
        # The first design of a few points is better than an equal one of many.
        if cost < self.cost * (1 - NO_LOWER) or (len(x) < len(self.points) and cost <= self.cost):
            self.points, self.weights, self.cost = x, weights, cost
        M = self.grid.region.problem(x).information(weights)
        known = np.concatenate([x, support])
        ends = []
        for Z in self._trials(active, M):
            margin = MARGIN_OF_ASCENT if self.alone else 0.0
            proof, found = RegionProof.of(self.grid, self.criterion, Z, known, M, margin)
            ends.append(found)
            if self.proof is None or self.is_refuted or proof.cost > self.proof.cost:
                self.proof = proof
                self.is_refuted = False
            # The second search is paid for only where the first one does not settle the matter.
            if self.gap <= enough:
                break
        # All ends of all rounds stay: each cuts off multipliers that overlook it. Where several
        # multipliers fit the same design, without them the rounds would go in circles.
        # A proof is sharper than that: there ends of one round, each about once, are enough for a
        # smooth criterion, and hundreds of others would blur the next weights.
        if self.alone or not (self.criterion.smooth and self.criterion.needs_all):
            ends.append(self.found)
        self.found = np.concatenate(ends)
        self._gaps.append(self.gap)
        return self.gap

    def _trials(self, active: ActiveSet, M: Array) -> list[Array]:
        """Multipliers (r, p, p) to search with: minus the gradient at a polished M, the solver's.

        The first are exact where the design is, but only where the cost is smooth.
        """
        of_solver = active.relaxation.multipliers
        if not self.criterion.smooth or self.criterion.most_subproblems > 1:
            return [of_solver]
        return [-self.criterion.gradient(M)[None], of_solver]

    def refuted(self, known: LargestSensitivities, higher: Mask) -> None:
        """Correct the proof, which the next one is to replace: sensitivities are larger.

        Args:
            known: What is known now.
            higher: Whether each of these (r,) is larger than what the search has found.
        """
        assert self.proof is not None
        largest = self.proof.largest.or_larger(known)
        self.proof = RegionProof.by(self.criterion, self.proof.multipliers, largest, self.proof.M)
        self.is_refuted = True
        self.found = np.concatenate([known.x[higher], self.found])

    def near(self, active: ActiveSet) -> Array:
        """Points of the grid that are all but in the design.

        A smooth criterion's multiplier follows from the design. Another one may have many, and
        without these points the next one would overlook what this one has learnt. They are taken
        only where the gap does not fall by itself, as solvers lose digits among points so close.
        """
        falls = len(self._gaps) < 2 or self._gaps[-1] < FAST * self._gaps[-2]
        if falls or (self.criterion.smooth and self.criterion.needs_all):
            return self.points[:0]
        problem = normalised(self.grid.problem, self.criterion)
        each = problem.sensitivities(active.relaxation.multipliers)
        return np.concatenate([self.grid.best(own, NEAR_POINTS) for own in each])

    def stuck(self, turn: int) -> bool:
        """Whether the last rounds have hardly closed the gap: a solver's accuracy is reached."""
        slow = (
            turn >= ROUNDS_TO_SHRINK
            and self._gaps[-1] > SHRUNK_TO * self._gaps[-1 - ROUNDS_TO_SHRINK]
        )
        return slow or turn == REGION_ROUNDS - 1

    def result(self, active: ActiveSet, judged: JudgedRegion) -> RelaxedRegion:
        """The best design with the best bound, and what the same multipliers prove on the grid.

        Args:
            active: The last relaxation.
            judged: Region and criterion that were searched.
        """
        criterion = self.criterion
        best = self.proof
        assert best is not None
        design = self.points, self.weights, self.cost
        x, weights, reached = on_few(self.grid.region, criterion, design)
        order = np.lexsort(np.round(x, 9).T[::-1])
        x = x[order]
        weights = weights[order]
        everything = np.concatenate([x, self.grid.x])
        candidates = Candidates(everything, self.grid.region.problem(everything))
        proved = LargestSensitivities.over(candidates, criterion, best.multipliers)
        on_grid = float(criterion.lower_bound(best.multipliers, proved.values, best.M))
        padded = np.concatenate([weights, np.zeros(len(self.grid.x))])
        of_cost, of_bound = judged.errors(everything, padded, best.multipliers)
        blurred = max(of_cost, BLURRED)

        def bound(cost: float, kind: BoundKind) -> Bound:
            return Bound.of(criterion, cost, reached, kind, of_bound, blurred)

        return RelaxedRegion(
            region=judged.region,
            criterion=criterion,
            judged=judged,
            points=x,
            weights=weights,
            cost=reached,
            proved_bound=bound(on_grid, BoundKind.PROVED_ON_CANDIDATES),
            searched_bound=bound(best.cost, BoundKind.SEARCHED),
            multipliers=best.multipliers,
            largest=best.largest,
            grid=self.grid.x,
            accuracy=of_cost + of_bound,
            solver=active.relaxation.solver,
            iterations=active.iterations,
        )


@dataclass(frozen=True, eq=False)
class RegionProof:
    """What multipliers prove over the whole region.

    Attributes:
        cost: The bound on the cost.
        multipliers: The multipliers (r, p, p).
        largest: The largest sensitivities to them.
        M: The design (p, p) that they belong to.
    """

    cost: float
    multipliers: Array
    largest: LargestSensitivities
    M: Array

    @classmethod
    def of(
        cls,
        grid: RegionGrid,
        criterion: Relaxable,
        Z: Array,
        known: Array,
        M: Array,
        margin: float = MARGIN_OF_ASCENT,
    ) -> "tuple[RegionProof, Array]":
        """Search the region with multipliers Z.

        Returns:
            The proof, and the points (n, d) where the ascents have ended.
        """
        Z = _lifted(Z) if criterion.monotone else Z
        largest, found = search_region(grid, criterion, Z, known, margin)
        return cls.by(criterion, Z, largest, M), found.x

    @classmethod
    def by(
        cls, criterion: Relaxable, Z: Array, largest: LargestSensitivities, M: Array
    ) -> "RegionProof":
        """What multipliers Z prove where these sensitivities are the largest."""
        bound = float(criterion.lower_bound(Z, largest.values, M))
        return cls(bound if np.isfinite(bound) else 0.0, Z, largest, M)


def _lifted(Z: Array) -> Array:
    """Multipliers (r, p, p) whose negative eigenvalues, which rounding leaves, are zero.

    A monotone criterion's multiplier proves nothing unless it is positive semidefinite.
    """
    d = np.sqrt(np.maximum(np.diagonal(Z, axis1=1, axis2=2), np.finfo(float).tiny))
    scale = d[:, :, None] * d[:, None]
    z, V = eigenpairs(Z / scale)
    return np.asarray((V * np.maximum(z, 0.0)[:, None]) @ np.swapaxes(V, 1, 2) * scale)


def _apart(region: Region, points: Array) -> Candidates:
    """The points that differ from all before them."""
    kept, _ = grouped(region, points, np.ones(len(points)), SAME_POINT)
    return Candidates(points[kept], region.problem(points[kept]))
