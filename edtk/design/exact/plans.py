"""Several plans of the same number of experiments, as arrays."""

from dataclasses import dataclass

import numpy as np

from edtk.design.design_space import DesignSpace
from edtk.system.typing import Array, Indices, Mask


@dataclass(frozen=True, eq=False)
class Plans:
    """Plans of k experiments with repetitions, as a search moves them all together.

    Attributes:
        x: Design variables (b, k, v).
        repeats: Whole numbers (b, k) of one sum; zero where an experiment is left out.
    """

    x: Array
    repeats: Array

    def __getitem__(self, chosen: Indices) -> "Plans":
        """The chosen plans."""
        return Plans(self.x[chosen], self.repeats[chosen])

    def replaced(self, better: Mask, others: "Plans") -> "Plans":
        """The same plans, with those of another batch where these are better (b,)."""
        return Plans(
            np.where(better[:, None, None], others.x, self.x),
            np.where(better[:, None], others.repeats, self.repeats),
        )

    def information(self, space: DesignSpace) -> Array:
        """Information matrices (b, p, p), the prior of the design space included."""
        return space.at(self.x).information(self.repeats)
