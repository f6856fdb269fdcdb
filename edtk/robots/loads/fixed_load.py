"""A load that leaves nothing to choose."""

from dataclasses import dataclass

import numpy as np

from edtk.robots.loads.load import Load
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class FixedLoad(Load):
    """The same wrench (6,) in every experiment [N, N m]."""

    always: Array

    @property
    def limits(self) -> Array:
        """Bounds (2, 0): a fixed load has no variables."""
        return np.zeros((2, 0))

    def wrench(self, u: Array) -> Array:
        """The wrench, for any u (..., 0)."""
        return np.broadcast_to(self.always, (*u.shape[:-1], len(self.always)))
