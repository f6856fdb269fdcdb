"""A marker whose position and orientation are measured."""

from dataclasses import dataclass

import numpy as np

from edtk.measure.instruments.sensor import Sensor, unit_translation
from edtk.robots.frames import Frames, columns_slope
from edtk.robots.rotations import inverse_left_jacobian, rotation_vector
from edtk.system.typing import Array, Mask

COORDINATES = 3  # rows before those of rotations


@dataclass(frozen=True, eq=False)
class PoseMarker(Sensor):
    """Six rows: the position of the point, then the rotation of its body, in world axes."""

    @property
    def rows(self) -> int:
        """Three coordinates and three angles."""
        return 6

    @property
    def lengths(self) -> Mask:
        """Coordinates are lengths, and rotations are not."""
        return np.arange(self.rows) < COORDINATES

    def motion(self, frames: Frames) -> Array:
        """Columns of the Jacobian at the point (n, 6, ...), linear ones first."""
        return np.concatenate([self.point.linear(frames), self.point.angular(frames)], axis=1)

    def motion_slope(self, frames: Frames, B: Array) -> Array:
        """See `columns_slope`."""
        linear = self.point.linear(frames)
        return columns_slope(linear, self.point.angular(frames), B[:, :3], B[:, 3:])

    def place(self, frames: Frames) -> Array:
        """Position (3, ...) [m]."""
        return self.point.position(frames)

    def translation(self, frames: Frames) -> Array:
        """The identity, and nothing for rotations."""
        return unit_translation(frames, 6)

    def change(self, before: Frames, after: Frames) -> Array:
        """Displacement and rotation vector (6, ...) [m, rad]."""
        moved = self.point.position(after) - self.point.position(before)
        return np.concatenate([moved, rotation_vector(self._turn(before, after))])

    def change_derivative(self, before: Frames, after: Frames, start: Array, end: Array) -> Array:
        """A rotation vector r changes by ``J_l(r)^-1 (w_after - R w_before)``, R the rotation."""
        rows = np.einsum("nr...,np...->rp...", after.folded(self.motion(after)), end)
        turn = self._turn(before, after)
        if start.any():
            first = np.einsum("nr...,np...->rp...", before.folded(self.motion(before)), start)
            rows[:3] -= first[:3]
            rows[3:] -= np.einsum("ij...,jp...->ip...", turn, first[3:])
        inverse = inverse_left_jacobian(np.moveaxis(rotation_vector(turn), 0, -1))
        rows[3:] = np.einsum("...ij,jp...->ip...", inverse, rows[3:])
        return rows

    def _turn(self, before: Frames, after: Frames) -> Array:
        """Rotations (3, 3, ...) from the one orientation to the other, in world axes."""
        axes = (self.point.orientation(before), self.point.orientation(after))
        return np.einsum("kj...,ki...->ij...", *axes)
