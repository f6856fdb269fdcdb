"""A load that is taken from a list."""

from dataclasses import dataclass

import numpy as np

from edtk.robots.loads.load import Load
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class ListedLoad(Load):
    """One of several wrenches (k, 6), whose index is u [N, N m]."""

    moves = False  # there is no wrench between two of the list
    wrenches: Array

    @property
    def limits(self) -> Array:
        """First and last index (2, 1)."""
        return np.array([[0.0], [len(self.wrenches) - 1.0]])

    def wrench(self, u: Array) -> Array:
        """The wrench of that index."""
        return self.wrenches[np.rint(u[..., 0]).astype(int)]

    def draw(self, cube: Array) -> Array:
        """Each wrench as likely as the others."""
        k = len(self.wrenches)
        return np.minimum(np.floor(k * cube), k - 1)
