"""The sheet on which a plan's measurements are written down."""

import csv
from pathlib import Path

import numpy as np
import pandas as pd

from edtk.calibration.visiting_order import visiting_order
from edtk.design.plan import Plan
from edtk.study.study import Study
from edtk.system.errors import UserError
from edtk.tables.sheet_columns import (
    DEFLECTION_COLUMNS,
    LOADED_COLUMNS,
    MARKER_COLUMNS,
    ROTATION_COLUMNS,
    SHEET_COLUMNS,
    UNLOADED_COLUMNS,
)


def template(study: Study, plan: Plan, positions: bool = False, markers: int = 0) -> pd.DataFrame:
    """A row per repetition, poses in an order of little joint travel, repetitions of a pose one after another.

    Args:
        study: Says what is measured.
        plan: What is to be measured.
        positions: Empty columns for the unloaded and the loaded position instead of the displacement.
        markers: Rows for so many markers in each repetition, with empty columns for where they are on the tool; 0 for a
            single one at the tool point.

    Returns:
        Poses and wrenches in the units of the headers, and empty columns to fill in: a measurement file to be.
    """
    lower, upper = study.robot.limits
    table = plan.to_frame(study.robot).iloc[visiting_order(plan.q, upper - lower)]
    table = (
        table.loc[table.index.repeat(table["repeats"])]
        .drop(columns="repeats")
        .reset_index(drop=True)
    )
    table = table.loc[table.index.repeat(max(markers, 1))].reset_index(drop=True)
    empty: tuple[str, ...] = (
        (*UNLOADED_COLUMNS, *LOADED_COLUMNS) if positions else DEFLECTION_COLUMNS
    )
    if study.specification.measurement.rows == "pose":
        empty += ROTATION_COLUMNS
    empty = (*(MARKER_COLUMNS if markers else ()), *empty)
    table[list(empty)] = np.nan
    return table


def filled(path: Path) -> bool | None:
    """Whether anything was written on a sheet, whatever separates its columns; None for a file that is no sheet."""
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        lines = (line for line in file if line.strip() and not line.startswith("#"))
        header = next(lines, "")[:10_000]  # of any file, such as a chain
        sign = max(",;\t", key=header.count)
        columns = [name.strip() for name in next(csv.reader([header], delimiter=sign), [])]
        if not set(columns) & {
            *DEFLECTION_COLUMNS,
            *LOADED_COLUMNS,
            *UNLOADED_COLUMNS,
            *ROTATION_COLUMNS,
        }:
            return None
        places = [i for i, name in enumerate(columns) if name in SHEET_COLUMNS]
        return any(
            row[i].strip()
            for row in csv.reader(lines, delimiter=sign)
            for i in places
            if i < len(row)
        )


def require_empty(path: Path) -> None:
    """Check that a file in this place, if there is one, is a sheet that has not been filled in.

    Raises:
        UserError: It is something else, or has; it is not to be overwritten.
    """
    if not path.exists() or not path.stat().st_size:
        return
    entries = filled(path)
    if entries is None:
        raise UserError(f"{path}: is there already and no empty sheet; expected another file")
    if entries:
        raise UserError(
            f"{path}: has measurements in it; expected another file for the empty sheet"
        )
