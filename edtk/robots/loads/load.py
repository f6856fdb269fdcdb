"""The interface of a choice of wrenches."""

from abc import ABC, abstractmethod

import numpy as np

from edtk.system.typing import Array


class Load(ABC):
    """The wrenches that an experiment may apply, described by variables u (..., d) without units.

    Attributes:
        moves: Whether a descent may change u; False where u counts instead of measuring.
    """

    moves: bool = True

    @property
    @abstractmethod
    def limits(self) -> Array:
        """Bounds (2, d) of the variables."""

    @abstractmethod
    def wrench(self, u: Array) -> Array:
        """Forces and torques (..., 6) [N, N m]."""

    def derivative(self, u: Array) -> Array:
        """Derivative (..., 6, d) of the wrench by u [N, N m]; zero unless a kind says otherwise."""
        return np.zeros((*u.shape[:-1], 6, u.shape[-1]))

    def draw(self, cube: Array) -> Array:
        """Variables (..., d) of points of the unit cube (..., d), uniform between the limits."""
        lower, upper = self.limits
        return lower + (upper - lower) * cube
