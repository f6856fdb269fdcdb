"""Which instrument each row of a measurement sheet is of, and where its point is."""

from collections.abc import Sequence

import numpy as np

from edtk.model.sensors.sensor import Sensor
from edtk.system.typing import Array, Indices, Mask
from edtk.tables.pose_table import PoseTable
from edtk.tables.sheet_columns import MARKER_COLUMNS, MARKER_NAME_COLUMN


def sheet_sensors(table: PoseTable, sensors: Sequence[Sensor]) -> Indices:
    """Index (m,) of each row's instrument, by the name in its column `marker`.

    A sheet of a single instrument may leave the column out.

    Args:
        table: The sheet.
        sensors: The instruments of the study.

    Raises:
        PoseFileError: The column is missing, or names an instrument that there is not.
    """
    names = [sensor.name for sensor in sensors]
    if MARKER_NAME_COLUMN not in table:
        if len(sensors) == 1:
            return np.zeros(len(table), dtype=int)
        raise table.error(
            f"column {MARKER_NAME_COLUMN!r} is missing; expected which of {', '.join(names)} each "
            "row is of"
        )
    given = table.texts(MARKER_NAME_COLUMN)
    unknown = next((i for i, name in enumerate(given) if name not in names), None)
    if unknown is not None:
        raise table.error(
            f"no marker {given[unknown]!r} in the study; expected one of {', '.join(names)}",
            f"row {unknown + 1}, column {MARKER_NAME_COLUMN}",
        )
    return np.array([names.index(name) for name in given])


def sheet_markers(
    table: PoseTable, sensors: Sequence[Sensor] = (), index: Indices | None = None
) -> Array:
    """Offsets (m, 3) of what is measured [m]: the sheet's, else the study's, else zero.

    Args:
        table: The sheet.
        sensors: The instruments of the study; there may be none.
        index: Index (m,) of each row's instrument; None without any.
    """
    if any(column in table for column in MARKER_COLUMNS):
        return table.vectors(MARKER_COLUMNS) / 1e3
    if index is None:
        return np.zeros((len(table), 3))
    return np.array([sensor.point.offset for sensor in sensors])[index]


def sheet_turns(sensors: Sequence[Sensor], index: Indices | None) -> Mask | None:
    """Whether each row (m,) of a sheet is a single rotation; None where none is.

    Args:
        sensors: The instruments of the study; there may be none.
        index: Index (m,) of each row's instrument; None without any.
    """
    if index is None:
        return None
    turn = np.array([not sensor.lengths.any() for sensor in sensors])[index]
    return turn if turn.any() else None


def stated_sigma(sigma: Array, sensors: Sequence[Sensor], index: Indices | None) -> Array:
    """The study's noise of each row of a sheet: (rows,), or (m, rows) of several instruments.

    Args:
        sigma: The study's noise, one instrument after another [m, rad].
        sensors: The instruments of the study, which measure as many rows each; there may be none.
        index: Index (m,) of each row's instrument; None without any.
    """
    return sigma if index is None else np.array(np.split(sigma, len(sensors)))[index]
