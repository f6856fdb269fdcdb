"""The interface of what a descent minimises."""

from abc import ABC, abstractmethod
from typing import NamedTuple

from edtk.design.interior_point.neighbourhood import Neighbourhood
from edtk.design.space import Points
from edtk.system.typing import Array, Indices


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
