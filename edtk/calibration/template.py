"""The sheet on which a plan's measurements are written down."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.calibration.visiting_order import visiting_order
from edtk.design.plan import Plan
from edtk.inference.sheet_change import DISTANCES, POSITIONS
from edtk.model.sensors.sensor import Sensor
from edtk.study.study import Study
from edtk.system.atomic_file import write_text
from edtk.tables.csv_text import csv_text
from edtk.tables.in_file_units import rounded
from edtk.tables.sheet_columns import (
    MARKER_COLUMNS,
    MARKER_NAME_COLUMN,
    ROTATION_COLUMNS,
    TURN_COLUMN,
    VISIT_COLUMN,
)

if TYPE_CHECKING:
    import pandas as pd


def template(study: Study, plan: Plan, positions: bool = False, markers: int = 0) -> "pd.DataFrame":
    """Make the empty sheet of a plan: a row per repetition, in an order of little joint travel.

    Repetitions of a pose come one after another. Angles have the digits that a controller takes.
    Where a visit has several rows, or errors of its own, a column numbers the visits.

    Args:
        study: Says which rows are measured.
        plan: The plan that is to be measured.
        positions: Empty columns for the unloaded and the loaded position instead of the
            displacement.
        markers: Rows for so many markers in each repetition, with empty columns for their places
            on the tool; 0 for a single one at the tool point, or for the instruments of the study.

    Returns:
        Poses and wrenches in the units of the headers, and empty columns to fill in: a measurement
        file to be.
    """
    lower, upper = study.robot.limits
    plan = replace(plan, q=rounded(study.robot, plan.q))
    table = plan.to_frame(study.robot).iloc[visiting_order(plan.q, upper - lower)]
    sensors = study.model.sensors
    rows = len(sensors) or max(markers, 1)
    times = table.pop("repeats") * rows
    table = table.loc[table.index.repeat(times)].reset_index(drop=True)
    if rows > 1 or study.noise is not None:
        table[VISIT_COLUMN] = np.arange(len(table)) // rows + 1
    if sensors:
        for column, values in _points(sensors, len(table) // len(sensors)).items():
            table[column] = values
    table[list(_empty_columns(study, positions, markers))] = np.nan
    return table


def _points(sensors: Sequence[Sensor], times: int) -> dict[str, Any]:
    """Columns that say which instrument each row is of, and where its point is [mm]."""
    names = {MARKER_NAME_COLUMN: [sensor.name for sensor in sensors] * times}
    offsets = np.tile([1e3 * sensor.point.offset for sensor in sensors], (times, 1))
    return names | dict(zip(MARKER_COLUMNS, offsets.T, strict=True))


def _empty_columns(study: Study, positions: bool, markers: int) -> tuple[str, ...]:
    """Columns that are to be filled in."""
    marker = MARKER_COLUMNS if markers else ()
    rows = study.model.instruments[0].rows
    changes, unloaded, loaded = DISTANCES if rows == 1 else POSITIONS
    turns = any(not sensor.lengths.any() for sensor in study.model.sensors)
    before = () if study.is_absolute else unloaded
    position = (*before, *loaded) if positions else changes
    turned = ROTATION_COLUMNS if rows == 6 else (TURN_COLUMN,) * turns
    return (*marker, *position, *turned)


def write_template(table: "pd.DataFrame", path: Path | str) -> None:
    """Write a sheet (CSV) to a file, whole or not at all, or to standard output (`-`)."""
    write_text(path, csv_text(table))
