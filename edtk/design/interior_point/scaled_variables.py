"""The variables of a descent: movable ones, in parts of their range."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edtk.design.space import Space
from edtk.system.typing import Array, Indices


@dataclass(frozen=True, eq=False)
class ScaledVariables:
    """The map between design variables x and movable variables y in [0, 1], for some starts.

    In parts of their range, angles, lengths and forces count alike.

    Args:
        space: Says which variables may move, and how far.
        x: Starts (n, k, v); the variables that do not move keep these values.
    """

    space: Space
    x: Array

    @cached_property
    def bounds(self) -> Array:
        """Lower and upper bounds (2, d) of the movable variables."""
        return self.space.limits[:, self.space.movable]

    @cached_property
    def bound_slopes(self) -> Array:
        """Gradients (2d, d) of the slacks ``y`` and ``1 - y`` of the bounds."""
        eye = np.eye(len(self.space.movable))
        return np.concatenate([eye, -eye])

    def begin(self) -> Array:
        """The starts as movable variables (n, k, d)."""
        lower, upper = self.bounds
        return np.asarray((self.x[..., self.space.movable] - lower) / (upper - lower))

    def design(self, y: Array, start: Indices) -> Array:
        """Design variables (b, k, v) within the bounds.

        Args:
            y: Movable variables (b, k, d).
            start: Indices (b,) of the starts that they belong to.
        """
        lower, upper = self.bounds
        x = self.x[start]
        # Rounding may carry a variable over its bound by a last digit.
        x[..., self.space.movable] = np.clip(lower + (upper - lower) * y, lower, upper)
        return x
