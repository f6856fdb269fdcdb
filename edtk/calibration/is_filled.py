"""Whether a sheet has measurements on it."""

import csv
from pathlib import Path

from edtk.tables.sheet_columns import (
    DEFLECTION_COLUMNS,
    LOADED_COLUMNS,
    ROTATION_COLUMNS,
    SHEET_COLUMNS,
    UNLOADED_COLUMNS,
)

# A sheet has at least one of these; a plan has none.
OF_A_SHEET = {*DEFLECTION_COLUMNS, *LOADED_COLUMNS, *UNLOADED_COLUMNS, *ROTATION_COLUMNS}
LONGEST_HEADER = 10_000  # characters; any file may be asked about, such as a chain without lines


def is_filled(path: Path) -> bool | None:
    """Tell whether anything was written on a sheet, whatever separates its columns.

    Args:
        path: Any file.

    Returns:
        None for a file that is no sheet.
    """
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        lines = (line for line in file if line.strip() and not line.startswith("#"))
        header = next(lines, "")[:LONGEST_HEADER]
        separator = max(",;\t", key=header.count)
        columns = [name.strip() for name in next(csv.reader([header], delimiter=separator), [])]
        if not set(columns) & OF_A_SHEET:
            return None
        places = [i for i, name in enumerate(columns) if name in SHEET_COLUMNS]
        for row in csv.reader(lines, delimiter=separator):
            if any(row[i].strip() for i in places if i < len(row)):
                return True
    return False
