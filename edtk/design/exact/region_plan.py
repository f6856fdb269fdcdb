"""A plan of whole experiments at points of a region, and how far it is from the bound."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from criteria import Criterion
from edtk.design.bound import Bound
from edtk.design.exact.bounded_plan import BoundedPlan
from edtk.design.region import Region
from edtk.design.relaxation.relaxed_region import RelaxedRegion
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class RegionPlan(BoundedPlan):
    """The best plan of some experiments in a region that a search has found.

    Attributes:
        relaxed: The relaxation that the search started from, with its bound.
        points: Points (k, d), in the order of their variables.
        counts: Number of new experiments at each (k,).
        kept: Number of experiments that were made already.
        cost: The criterion's cost of all experiments together.
        starts: Number of starts of the search.
        found: How many of them led to a plan as good as this one.
        seconds: Duration of the search [s], the relaxation included.
    """

    relaxed: RelaxedRegion
    points: Array
    counts: Indices
    kept: int
    cost: float
    starts: int
    found: int
    seconds: float

    def headline(self) -> str:
        """Criterion, value, size and efficiency."""
        return (
            f"{self.criterion.label} = {self.value:.6g} with {self.size} experiments at "
            f"{len(self.points)} points, efficiency {100 * self.efficiency:.2f} % "
            f"({self.lower_bound.kind.value} bound)"
        )

    @property
    def region(self) -> Region:
        """The region; what was kept is part of its prior."""
        return self.relaxed.region

    @property
    def criterion(self) -> Criterion:
        """What was minimised."""
        return self.relaxed.criterion

    @property
    def size(self) -> int:
        """Number of experiments, kept ones included."""
        return int(self.counts.sum()) + self.kept

    @property
    def experiments(self) -> Array:
        """Points (m, d) of all new experiments, each as often as it is measured."""
        return np.repeat(self.points, self.counts, axis=0)

    @property
    def lower_bound(self) -> Bound:
        """The bound on the cost of every plan of so many experiments."""
        # What was kept is part of the relaxation's prior, in equal parts for each new experiment.
        return self.relaxed.searched_bound.scaled(int(self.counts.sum()))

    @property
    def information(self) -> Array:
        """Information matrix (p, p) of all experiments, kept ones and the prior included."""
        return self.region.problem(self.points).information(self.counts)

    def to_frame(self) -> "pd.DataFrame":
        """Make a table with a point a row and its number of experiments in the last column."""
        import pandas as pd

        frame = pd.DataFrame(self.points, columns=list(self.region.variables))
        return frame.assign(count=self.counts)
