"""Instruments as they stand, where rows of some are listed one by one."""

from collections.abc import Iterable

from edtk.model.sensors.one_row import OneRow
from edtk.model.sensors.sensor import Sensor


def whole_instruments(sensors: Iterable[Sensor]) -> tuple[Sensor, ...]:
    """List each instrument once; all rows of one follow each other, the first of them ahead."""
    found: list[Sensor] = []
    for sensor in sensors:
        if not isinstance(sensor, OneRow):
            found.append(sensor)
        elif sensor.row == 0:
            found.append(sensor.whole)
    return tuple(found)
