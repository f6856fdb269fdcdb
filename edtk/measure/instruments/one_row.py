"""A single row of another instrument, where a sheet has a row for each coordinate."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from edtk.measure.instruments.marker import Marker
from edtk.measure.instruments.sensor import Sensor
from edtk.robots.frames import BodyPoint, Frames
from edtk.system.typing import Array, Mask


@dataclass(frozen=True, eq=False)
class OneRow(Sensor):
    """One row: a coordinate, or a rotation about an axis, that another instrument measures.

    Attributes:
        whole: The other instrument, of the same point.
        row: Its row.
    """

    whole: Sensor = field(default_factory=Marker)
    row: int = 0

    @property
    def rows(self) -> int:
        """One coordinate."""
        return 1

    @property
    def lengths(self) -> Mask:
        """Whether the row (1,) is a length."""
        return self.whole.lengths[self._only]

    def at(self, point: BodyPoint) -> "OneRow":
        """The same row of the instrument at another point."""
        return replace(self, point=point, whole=self.whole.at(point))

    def motion(self, frames: Frames) -> Array:
        """The row of the whole motion (n, 1, ...)."""
        return self.whole.motion(frames)[:, self._only]

    def motion_slope(self, frames: Frames, B: Array) -> Array:
        """The slope of the whole motion, weighted in this row alone."""
        weights = np.zeros((len(B), self.whole.rows, *B.shape[2:]))
        weights[:, self._only] = B
        return self.whole.motion_slope(frames, weights)

    def place(self, frames: Frames) -> Array:
        """Coordinate (1, ...) [m]; nothing (0, ...) for a rotation."""
        return self.whole.place(frames)[self._only]

    def translation(self, frames: Frames) -> Array:
        """The row of the whole derivative (1, 3, ...)."""
        return self.whole.translation(frames)[self._only]

    def change(self, before: Frames, after: Frames) -> Array:
        """Change of the coordinate (1, ...) [m, rad]."""
        return self.whole.change(before, after)[self._only]

    def change_derivative(self, before: Frames, after: Frames, start: Array, end: Array) -> Array:
        """The row of the whole derivative (1, p, ...)."""
        return self.whole.change_derivative(before, after, start, end)[self._only]

    @property
    def _only(self) -> slice:
        """The row, as a slice of all."""
        return slice(self.row, self.row + 1)


def whole_instruments(sensors: Iterable[Sensor]) -> tuple[Sensor, ...]:
    """List each instrument once; all rows of one follow each other, the first of them ahead."""
    found: list[Sensor] = []
    for sensor in sensors:
        if not isinstance(sensor, OneRow):
            found.append(sensor)
        elif sensor.row == 0:
            found.append(sensor.whole)
    return tuple(found)


def whole_of(sensor: Sensor) -> tuple[Sensor, slice]:
    """The instrument that a sensor is, or is a row of, and which of its rows that is."""
    if isinstance(sensor, OneRow):
        return sensor.whole, slice(sensor.row, sensor.row + 1)
    return sensor, slice(None)
