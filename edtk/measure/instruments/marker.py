"""A marker whose position is measured."""

from dataclasses import dataclass

from edtk.measure.instruments.sensor import Sensor, unit_translation
from edtk.robots.frames import Frames, columns_slope
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class Marker(Sensor):
    """Three rows: the position of the point in the world."""

    @property
    def rows(self) -> int:
        """Three coordinates."""
        return 3

    def motion(self, frames: Frames) -> Array:
        """Linear columns of the Jacobian at the point (n, 3, ...)."""
        return self.point.linear(frames)

    def motion_slope(self, frames: Frames, B: Array) -> Array:
        """See `columns_slope`."""
        return columns_slope(self.point.linear(frames), self.point.angular(frames), B)

    def place(self, frames: Frames) -> Array:
        """Position (3, ...) [m]."""
        return self.point.position(frames)

    def translation(self, frames: Frames) -> Array:
        """The identity."""
        return unit_translation(frames, 3)

    def change(self, before: Frames, after: Frames) -> Array:
        """Displacement (3, ...) [m]."""
        return self.point.position(after) - self.point.position(before)
