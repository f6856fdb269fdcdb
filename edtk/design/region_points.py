"""Points of a region: their information, slacks, and derivatives."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from edtk.design.experiments import weighted_information
from edtk.design.packed import pack_gram
from edtk.system.typing import Array, Mask

if TYPE_CHECKING:
    from edtk.design.region import Region

FEASIBLE = 1e-10  # by which rounding may carry a point over a constraint, in the constraint's units


@dataclass(frozen=True, eq=False)
class RegionPoints:
    """Points x (..., d) of a region.

    Args:
        space: The region.
        x: Points (..., d).
    """

    space: "Region"
    x: Array

    @cached_property
    def regressor(self) -> Array:
        """Whitened rows (..., rows, p)."""
        return self.space.rows_at(self.x)

    @cached_property
    def derivative(self) -> Array:
        """Derivatives (..., rows, p, d) of the whitened rows."""
        return self.space.derivative_at(self.x)

    @property
    def packed(self) -> Array:
        """Information of one experiment each, packed (p(p+1)/2, ...), without the prior."""
        A = self.regressor
        return pack_gram(A.transpose(A.ndim - 1, A.ndim - 2, *range(A.ndim - 2)))

    @cached_property
    def slack(self) -> Array:
        """Slacks (..., c) of the constraints; negative means infeasible."""
        return self.space.slack_at(self.x)

    @cached_property
    def slack_gradient(self) -> Array:
        """Derivatives (..., c, d) of the slacks."""
        return self.space.slack_derivative_at(self.x)

    @property
    def feasible(self) -> Mask:
        """Whether each point (...) lies in the box and satisfies the constraints."""
        low, high = self.space.limits
        within = ((self.x >= low) & (self.x <= high)).all(axis=-1)
        return np.asarray(within & (self.slack >= -FEASIBLE).all(axis=-1))

    def visited(self, visits: Array) -> "RegionPoints":
        """The same points: repeats share no error."""
        return self

    def information(self, repeats: Array) -> Array:
        """Information matrices (b, p, p) of plans (b, k) with repetitions or weights (b, k)."""
        return weighted_information(self.regressor, repeats, self.space.prior)

    def slope(self, B: Array) -> Array:
        """Derivatives (..., d) of ``<B, A>`` of the whitened rows A by the point, B held fixed."""
        return np.einsum("...rp,...rpd->...d", B, self.derivative)
