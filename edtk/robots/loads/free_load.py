"""A force of any direction."""

from dataclasses import dataclass

import numpy as np

from edtk.robots.loads.load import Load
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class FreeLoad(Load):
    """Any force up to a size [N], |F| <= F_max (Eq. 22), and no torque.

    In polar variables ``u = (r, e, a)``, size, elevation and azimuth,
    ``F = F_max r (cos e cos a, cos e sin a, sin e)``, so that the limit is a plain bound
    ``|r| <= 1``. The elevation may pass the poles. A negative r reverses the force: without it a
    descent that starts in the wrong direction would end at no force at all.
    """

    largest: float

    @property
    def limits(self) -> Array:
        """Bounds (2, 3): the largest force, half a turn and a whole turn, all to either side."""
        return np.array([[-1.0, -np.pi, -2 * np.pi], [1.0, np.pi, 2 * np.pi]])

    def wrench(self, u: Array) -> Array:
        """``(F, 0)``."""
        r, e, a = np.moveaxis(u, -1, 0)
        direction = [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]
        zero = np.zeros_like(r)
        return np.stack([*(self.largest * r * f for f in direction), zero, zero, zero], axis=-1)

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
        """Uniform in the ball of forces.

        The first coordinate is the share of the ball's volume inside the force's size, the second
        the share of the sphere's area below its elevation, the third the azimuth.
        """
        e = np.arcsin(np.clip(2 * cube[..., 1] - 1, -1.0, 1.0))
        return np.stack([np.cbrt(cube[..., 0]), e, np.pi * (2 * cube[..., 2] - 1)], axis=-1)
