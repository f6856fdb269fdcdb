"""Whether a sheet has measurements on it."""

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import TextIO

from edtk.system.read_text import BYTE_ORDER_MARKS
from edtk.tables.sheet_columns import (
    DEFLECTION_COLUMNS,
    LOADED_COLUMNS,
    MARKER_COLUMNS,
    MARKER_NAME_COLUMN,
    ROTATION_COLUMNS,
    SHEET_COLUMNS,
    UNLOADED_COLUMNS,
    VISIT_COLUMN,
)

# A sheet has at least one of these; a plan has none.
OF_A_SHEET = {*DEFLECTION_COLUMNS, *LOADED_COLUMNS, *UNLOADED_COLUMNS, *ROTATION_COLUMNS}
# The number of a visit is written beforehand, and markers where the study names them.
BEFOREHAND = {VISIT_COLUMN, MARKER_NAME_COLUMN, *MARKER_COLUMNS}
LONGEST_HEADER = 10_000  # characters; any file may be asked about, such as a chain without lines


def is_filled(path: Path) -> bool | None:
    """Tell whether anything was written on a sheet, whatever separates its columns.

    Args:
        path: Any file.

    Returns:
        None for a file that is no sheet, as no device and no pipe is.
    """
    if not path.is_file():
        return None
    with path.open("rb") as raw:
        encoding = BYTE_ORDER_MARKS.get(raw.read(2), "utf-8-sig")
    with path.open(encoding=encoding, errors="replace", newline="") as file:
        header = _header(file)
        separator = max(",;\t", key=header.count)
        columns = [name.strip() for name in next(csv.reader([header], delimiter=separator), [])]
        if not set(columns) & OF_A_SHEET:
            return None
        written = BEFOREHAND if MARKER_NAME_COLUMN in columns else {VISIT_COLUMN}
        to_fill_in = set(SHEET_COLUMNS) - written
        places = [i for i, name in enumerate(columns) if name in to_fill_in]
        lines = (line for line in file if not line.startswith("#"))
        try:
            return _has_content(csv.reader(lines, delimiter=separator), places)
        except csv.Error:  # a cell of more than a hundred thousand characters: no empty sheet
            return True


def _header(file: TextIO) -> str:
    """The first line with content, as far as a header may reach: the file may have no lines."""
    while line := file.readline(LONGEST_HEADER):
        if line.strip() and not line.startswith("#"):
            return line
    return ""


def _has_content(rows: Iterable[list[str]], places: list[int]) -> bool:
    """Whether a cell in one of these places is not blank."""
    return any(row[i].strip() for row in rows for i in places if i < len(row))
