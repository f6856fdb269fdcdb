"""The points of a region that a search begins with: a grid, its corners, and points on walls."""

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from edtk.design.interior_point.inward import inward
from edtk.design.problem import Problem
from edtk.design.region import Region
from edtk.design.region_points import FEASIBLE
from edtk.design.relaxation.onto_walls import onto_walls
from edtk.system.errors import ArgumentError, UserError
from edtk.system.typing import Array, Indices

POINTS = 5000  # of a grid, at most, unless the caller says otherwise
CORNERS = 10  # variables up to which all corners of the box are points: designs often lie there
PUSHED = 1000  # infeasible points that are moved onto the constraints, at most
NEAR = 0.01  # parts of a range up to which such points are moved
NEIGHBOURS = 30  # among which a point must be the best to begin an ascent


@dataclass(frozen=True, eq=False)
class RegionGrid:
    """Feasible points x (n, d) of a region, spread evenly.

    Attributes:
        region: The region.
        x: The points.
    """

    region: Region
    x: Array

    @classmethod
    def of(cls, region: Region, n: int = POINTS) -> "RegionGrid":
        """Lay a grid of at most about n points over the box and keep what is feasible.

        The levels of a variable are odd in number, so that the middle is one. Where a grid would
        have fewer than five, points of Sobol's sequence fill up what it leaves open. Infeasible
        points are moved onto the constraints, where optimal designs often lie.

        Raises:
            UserError: No point is feasible, or n < 2.
        """
        if n < 2:
            raise ArgumentError("expected at least two", argument="candidates", given=n)
        low, high = region.limits
        x = low + (high - low) * _cube(region.size, n)
        slack = region.slack_at(x)
        feasible = (slack >= -FEASIBLE).all(axis=1)
        kept = [x[feasible]]
        outside = np.flatnonzero(~feasible)
        if len(outside):
            some = outside[np.linspace(0, len(outside) - 1, min(PUSHED, len(outside))).astype(int)]
            # They come to lie a margin inside, and from there on the walls themselves.
            moved = onto_walls(region, inward(region, x[some]), NEAR)
            kept.append(moved[region.at(moved).feasible])
        points = np.unique(np.concatenate(kept), axis=0)
        if not len(points):
            worst = int((slack < -FEASIBLE).sum(axis=0).argmax())
            raise UserError(
                f"no feasible point among {len(x)}; constraint {worst + 1} excludes "
                f"{np.mean(slack[:, worst] < -FEASIBLE):.0%} of them"
            )
        return cls(region, points)

    @cached_property
    def problem(self) -> Problem:
        """The points as candidates."""
        return self.region.problem(self.x)

    @cached_property
    def _neighbours(self) -> Indices:
        """Indices (n, k) of the points nearest to each, itself included."""
        from scipy.spatial import cKDTree

        low, high = self.region.limits
        y = (self.x - low) / (high - low)
        k = min(3**self.region.size, NEIGHBOURS, len(y))
        found = cKDTree(y).query(y, k)[1]
        return np.asarray(found).reshape(len(y), k)

    def best(self, values: Array, most: int) -> Array:
        """The points (k, d) of the largest values (n,)."""
        if len(values) <= most:
            return self.x
        return self.x[np.argpartition(-values, most)[:most]]

    def maxima(self, values: Array, most: int) -> Array:
        """The points (k, d) whose value (n,) no neighbour exceeds, the largest first."""
        best = np.flatnonzero(values >= values[self._neighbours].max(axis=1))
        order = np.argsort(-values[best], kind="stable")
        return self.x[best[order[:most]]]


def _cube(d: int, n: int) -> Array:
    """Points (m, d) of the unit cube: a grid, its corners, and Sobol's sequence."""
    levels = int(n ** (1 / d) + 1e-9)
    levels -= 1 - levels % 2
    parts = []
    if levels >= 3:
        parts.append(np.array(list(product(np.linspace(0, 1, levels), repeat=d))))
    elif d <= CORNERS:
        parts.append(np.array(list(product((0.0, 1.0), repeat=d))))
    if levels < 5:
        from scipy.stats import qmc

        power = max(1, int(np.ceil(np.log2(n / 2))))
        parts.append(qmc.Sobol(d, rng=np.random.default_rng(0)).random_base2(power))
    return np.concatenate(parts)
