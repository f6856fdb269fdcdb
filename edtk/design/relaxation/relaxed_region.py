"""A design over a region: points and weights, with bounds and what proves them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from criteria import Criterion, Relaxable
from edtk.design.bound import Bound, BoundKind, printed_form
from edtk.design.region import Region
from edtk.design.relaxation.certify import certify
from edtk.design.relaxation.inner_proof import InnerProof
from edtk.design.relaxation.judged_region import JudgedRegion
from edtk.design.relaxation.largest_sensitivities import LargestSensitivities
from edtk.design.relaxation.normalised import normalised
from edtk.design.relaxation.relaxation import VISIBLE, Relaxation
from edtk.system.presented import Presented
from edtk.system.typing import Array

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class RelaxedRegion(Presented):
    """Points of a region and the share of the experiments that each should have.

    Attributes:
        region: The region.
        criterion: What was minimised.
        judged: Both as the search saw them: with all of the prior, in parameters that lose nothing.
        points: Points (k, d), in the order of their variables.
        weights: Their shares (k,) of the experiments, of sum one.
        cost: The criterion's cost.
        grid_bound: Proved: no design over the grid and these points has a lower cost.
        searched_bound: Not proved: no design over the region has a lower cost, provided that the
            ascents have found the largest sensitivities.
        multipliers: The proof of the bounds (r, p, p) in the judged parameters, see
            `Relaxable.lower_bound`.
        largest: The largest sensitivities that were found in the region, and where.
        grid: Points (n, d) of the grid.
        accuracy: Relative error that rounding may have made in cost and bounds, see
            `relative_accuracy`.
        solver: The solver that found the weights.
        iterations: Number of restricted master problems that were solved.
    """

    region: Region
    criterion: Criterion
    judged: JudgedRegion
    points: Array
    weights: Array
    cost: float
    grid_bound: Bound
    searched_bound: Bound
    multipliers: Array
    largest: LargestSensitivities
    grid: Array
    accuracy: float
    solver: str
    iterations: int

    def headline(self) -> str:
        """Criterion, value, number of points, and gap with its kind."""
        digits = f", numbers to {self.accuracy:.0e}" if self.accuracy > VISIBLE else ""
        return (
            f"{self.criterion.label} = {self.value:.6g} with weights on {len(self.points)} points, "
            f"{self.kind.value} gap {self.gap:.1e}{digits}"
        )

    @property
    def value(self) -> float:
        """The criterion as its formula prints it."""
        return printed_form(self.cost, self.criterion.sense)

    @property
    def bound(self) -> float:
        """The bound over the whole region as the criterion's formula prints it."""
        return self.searched_bound.value

    @property
    def kind(self) -> BoundKind:
        """What the claim of `bound` rests on."""
        return self.searched_bound.kind

    @property
    def gap(self) -> float:
        """Relative gap ``1 - bound/cost`` of the bound over the whole region."""
        return self.searched_bound.gap_to(self.cost)

    @property
    def information(self) -> Array:
        """Information matrix (p, p) of one experiment's worth of this design."""
        return self.region.problem(self.points).information(self.weights)

    def on_grid(self) -> Relaxation:
        """The design as a relaxation over its own points and those of the grid, in this order.

        Its bound is proved, and its certificate can be checked: `edtk.verify` takes what
        ``on_grid().to_dict()`` writes, with ``on_grid().problem`` beside it. Cost and bound are
        computed anew.
        """
        problem = self.region.problem(np.concatenate([self.points, self.grid]))
        weights = np.concatenate([self.weights, np.zeros(len(self.grid))])
        T = self.judged.T
        inner = None if T is None else InnerProof(T, self.multipliers)
        Z = self.multipliers if inner is None else inner.outward()
        assert isinstance(self.criterion, Relaxable)
        cost, bound = certify(problem, self.criterion, weights, Z, inner)
        kind = BoundKind.PROVED_ON_CANDIDATES
        return Relaxation(
            criterion=self.criterion,
            weights=weights,
            cost=cost,
            proved_bound=Bound.of(self.criterion, bound, cost, kind),
            multipliers=Z,
            solver=self.solver,
            iterations=self.iterations,
            problem=problem,
            accuracy=self.accuracy,
            rests_on_solver=self.criterion.rests_on_solver(self.multipliers, self._judged_M),
            inner=inner,
        )

    @property
    def _judged_M(self) -> Array:
        """Information matrix (p, p) of the judged parameters."""
        return self.judged.region.problem(self.points).information(self.weights)

    def sensitivities(self, x: Array) -> Array:
        """Sensitivities (r, n) of points x (n, d) in parts of the largest one.

        At an optimum of a smooth criterion none is above one, and they are one at its points: the
        equivalence theorem.
        """
        problem = normalised(self.judged.region.problem(x), self.judged.criterion)
        return np.asarray(problem.sensitivities(self.multipliers) / self.largest.values[:, None])

    def to_frame(self) -> "pd.DataFrame":
        """Make a table with a point a row and its weight in the last column."""
        import pandas as pd

        frame = pd.DataFrame(self.points, columns=list(self.region.variables))
        return frame.assign(weight=self.weights)
