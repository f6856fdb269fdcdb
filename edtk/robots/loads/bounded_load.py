"""A load of fixed direction and free size."""

from dataclasses import dataclass

import numpy as np

from edtk.robots.loads.load import Load
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class BoundedLoad(Load):
    """A part u in [0, 1] of the largest wrench (6,), along its direction [N, N m]."""

    largest: Array

    @property
    def limits(self) -> Array:
        """From no load to the largest (2, 1)."""
        return np.array([[0.0], [1.0]])

    def wrench(self, u: Array) -> Array:
        """``u`` times the largest wrench."""
        return u * self.largest

    def derivative(self, u: Array) -> Array:
        """The largest wrench (..., 6, 1)."""
        return np.broadcast_to(self.largest[:, None], (*u.shape[:-1], 6, 1))
