"""The sheet on which a plan's measurements are written down."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from edtk.calibration.visiting_order import visiting_order
from edtk.design.plan import Plan
from edtk.study.study import Study
from edtk.system.atomic_file import write_text
from edtk.tables.csv_text import csv_text
from edtk.tables.in_file_units import rounded
from edtk.tables.sheet_columns import (
    DEFLECTION_COLUMNS,
    LOADED_COLUMNS,
    MARKER_COLUMNS,
    ROTATION_COLUMNS,
    UNLOADED_COLUMNS,
)

if TYPE_CHECKING:
    import pandas as pd


def template(study: Study, plan: Plan, positions: bool = False, markers: int = 0) -> "pd.DataFrame":
    """Make the empty sheet of a plan: a row per repetition, in an order of little joint travel.

    Repetitions of a pose come one after another. Angles have the digits that a controller takes.

    Args:
        study: Says which rows are measured.
        plan: The plan that is to be measured.
        positions: Empty columns for the unloaded and the loaded position instead of the
            displacement.
        markers: Rows for so many markers in each repetition, with empty columns for their places
            on the tool; 0 for a single one at the tool point.

    Returns:
        Poses and wrenches in the units of the headers, and empty columns to fill in: a measurement
        file to be.
    """
    lower, upper = study.robot.limits
    plan = replace(plan, q=rounded(study.robot, plan.q))
    table = plan.to_frame(study.robot).iloc[visiting_order(plan.q, upper - lower)]
    times = table.pop("repeats") * max(markers, 1)
    table = table.loc[table.index.repeat(times)].reset_index(drop=True)
    table[list(_empty_columns(study, positions, markers))] = np.nan
    return table


def _empty_columns(study: Study, positions: bool, markers: int) -> tuple[str, ...]:
    """Columns that are to be filled in."""
    marker = MARKER_COLUMNS if markers else ()
    position = (*UNLOADED_COLUMNS, *LOADED_COLUMNS) if positions else DEFLECTION_COLUMNS
    turned = ROTATION_COLUMNS if study.specification.measurement.rows == "pose" else ()
    return (*marker, *position, *turned)


def write_template(table: "pd.DataFrame", path: Path | str) -> None:
    """Write a sheet (CSV) to a file, whole or not at all, or to standard output (`-`)."""
    write_text(path, csv_text(table))
