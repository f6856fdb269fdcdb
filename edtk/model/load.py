"""What loads an experiment may apply: one, one of bounded size, one of a list, or any of bounded size (Eq. 21-22)."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Load(ABC):
    """A family of wrenches, described by variables u (..., d) without units."""

    moves: bool = True  # whether a descent may change u

    @property
    @abstractmethod
    def limits(self) -> Array:
        """Bounds (2, d) of the variables."""

    @abstractmethod
    def wrench(self, u: Array) -> Array:
        """Forces and torques (..., 6) [N, N m]."""

    def derivative(self, u: Array) -> Array:
        """Derivative (..., 6, d) of the wrench."""
        return np.zeros((*u.shape[:-1], 6, u.shape[-1]))

    def draw(self, cube: Array) -> Array:
        """Variables (..., d) of points of the unit cube (..., d)."""
        lower, upper = self.limits
        return lower + (upper - lower) * cube


@dataclass(frozen=True, eq=False)
class FixedLoad(Load):
    """The same wrench (6,) in every experiment [N, N m]."""

    always: Array

    @property
    def limits(self) -> Array:
        """None."""
        return np.zeros((2, 0))

    def wrench(self, u: Array) -> Array:
        """That wrench, whatever u (..., 0)."""
        return np.broadcast_to(self.always, (*u.shape[:-1], 6))


@dataclass(frozen=True, eq=False)
class BoundedLoad(Load):
    """A part u in [0, 1] of the largest wrench (6,): the direction is fixed, the size is not [N, N m]."""

    largest: Array

    @property
    def limits(self) -> Array:
        """From nothing to the whole."""
        return np.array([[0.0], [1.0]])

    def wrench(self, u: Array) -> Array:
        """``u`` times the largest."""
        return u * self.largest

    def derivative(self, u: Array) -> Array:
        """The largest."""
        return np.broadcast_to(self.largest[:, None], (*u.shape[:-1], 6, 1))


@dataclass(frozen=True, eq=False)
class ListedLoad(Load):
    """One of several wrenches (k, 6), whose index is u [N, N m]."""

    moves = False
    wrenches: Array

    @property
    def limits(self) -> Array:
        """First and last index."""
        return np.array([[0.0], [len(self.wrenches) - 1.0]])

    def wrench(self, u: Array) -> Array:
        """The one of that index."""
        return self.wrenches[np.rint(u[..., 0]).astype(int)]

    def draw(self, cube: Array) -> Array:
        """Each as likely as the others."""
        k = len(self.wrenches)
        return np.minimum(np.floor(k * cube), k - 1)


@dataclass(frozen=True, eq=False)
class FreeLoad(Load):
    """Any force up to a size [N], |F| <= F_max (Eq. 22), and no torque.

    In polar variables ``u = (r, elevation, azimuth)``, ``F = F_max r (cos e cos a, cos e sin a, sin e)``, so that the
    limit is a plain bound ``|r| <= 1``; the elevation may pass the poles. A negative r reverses the force: without it
    a descent that aims the wrong way would end at no force at all.
    """

    largest: float

    @property
    def limits(self) -> Array:
        """The largest force, elevation half a turn and azimuth a whole turn, all to either side."""
        return np.array([[-1.0, -np.pi, -2 * np.pi], [1.0, np.pi, 2 * np.pi]])

    def wrench(self, u: Array) -> Array:
        """``(F, 0)``."""
        r, e, a = np.moveaxis(u, -1, 0)
        F = [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]
        zero = np.zeros_like(r)
        return np.stack([*(self.largest * r * f for f in F), zero, zero, zero], axis=-1)

    def derivative(self, u: Array) -> Array:
        """By size, elevation and azimuth (..., 6, 3)."""
        r, e, a = np.moveaxis(u, -1, 0)
        zero = np.zeros_like(r)
        by_size = [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]
        by_elevation = [-r * np.sin(e) * np.cos(a), -r * np.sin(e) * np.sin(a), r * np.cos(e)]
        by_azimuth = [-r * np.cos(e) * np.sin(a), r * np.cos(e) * np.cos(a), zero]
        columns = [
            np.stack([*f, zero, zero, zero], axis=-1) for f in (by_size, by_elevation, by_azimuth)
        ]
        return self.largest * np.stack(columns, axis=-1)

    def draw(self, cube: Array) -> Array:
        """Uniform in the ball: the first coordinate is the share of the volume inside, the second that of the area."""
        e = np.arcsin(np.clip(2 * cube[..., 1] - 1, -1.0, 1.0))
        return np.stack([np.cbrt(cube[..., 0]), e, np.pi * (2 * cube[..., 2] - 1)], axis=-1)
