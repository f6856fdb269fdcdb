"""What a descent minimises, and its second derivatives as differences of analytic first ones."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from edtk.design.design_space import Points, Space
from edtk.system.typing import Array, Indices

# Distance to a neighbour, in parts of a variable's range. Differences of analytic slopes lose
# about 1e-16/1e-6 to rounding and 1e-6 to curvature, which is plenty for a Newton step.
STEP = 1e-6


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """Experiments, and beside each the same one moved a little along each movable variable.

    Derivatives are by the d movable variables, in parts of their range, so that angles, lengths and
    forces count alike. First derivatives are analytic. A few more poses in the same array
    operations cost little and give second ones.

    Args:
        space: What may move, and how far.
        x: Design variables (b, k, v).
    """

    space: Space
    x: Array

    @cached_property
    def span(self) -> Array:
        """Ranges (d,) of the movable variables."""
        lower, upper = self.space.limits[:, self.space.movable]
        return np.asarray(upper - lower)

    @cached_property
    def experiments(self) -> Points:
        """The experiments themselves and their neighbours (1 + d, b, k)."""
        move = self.space.movable
        neighbours = np.arange(1, 1 + len(move))
        x = np.repeat(self.x[None], 1 + len(move), axis=0)
        steps = STEP * self.span
        x[neighbours, ..., move] += steps.reshape(-1, *[1] * (self.x.ndim - 1))
        return self.space.at(x)

    def first(self, gradient: Array) -> Array:
        """First derivatives (..., d) of gradients (..., v) by all design variables."""
        return gradient[..., self.space.movable] * self.span

    def differences(self, values: Array) -> Array:
        """Derivatives (d, b, k, ...) of values (1 + d, b, k, ...), by difference."""
        return np.asarray((values[1:] - values[0]) / STEP)

    def second(self, first: Array) -> Array:
        """Second derivatives (b, k, ..., d, d) of first ones (1 + d, b, k, ..., d).

        The mean with the transpose removes what differences break of the symmetry.
        """
        H = self.differences(first)
        H = H.transpose(*range(1, H.ndim - 1), 0, H.ndim - 1)
        return 0.5 * (H + np.swapaxes(H, -1, -2))


class Local(NamedTuple):
    """Value and derivatives of an objective, for b starts of k experiments each.

    Derivatives are by the d movable variables in parts of their range, see `Neighbourhood`.

    Attributes:
        value: Values (b,).
        slope: First derivatives (b, k, d).
        own: Second derivatives (b, k, d, d) by the variables of one experiment.
        joint: Second derivatives (b, kd, kd) by the variables of all, to which `own` is added.
    """

    value: Array
    slope: Array
    own: Array
    joint: Array


class Objective(ABC):
    """A function of groups of experiments, to be minimised by `descend`.

    Its values should be of order one, as the accuracy of a descent is absolute.
    """

    @abstractmethod
    def value(self, here: Points, start: Indices) -> Array:
        """Values (b,) of experiments (b, k), some of which may be inf.

        Args:
            here: The experiments.
            start: Indices (b,) of the starts that they belong to.
        """

    @abstractmethod
    def local(self, near: Neighbourhood, start: Indices) -> Local:
        """Values and derivatives.

        Args:
            near: Experiments (b, k) and their neighbours.
            start: Indices (b,) of the starts that they belong to.
        """
