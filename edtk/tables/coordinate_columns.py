"""What the coordinates of a measurement are called, in files and for people."""

from edtk.tables.sheet_columns import CHANGE_COLUMN, DEFLECTION_COLUMNS, ROTATION_COLUMNS

NAMES = ("x", "y", "z", "rotation x", "rotation y", "rotation z")


def coordinate_columns(rows: int) -> tuple[str, ...]:
    """Headers of the coordinates of positions (3 rows), poses (6) or distances (1)."""
    if rows == 1:
        return (CHANGE_COLUMN,)
    return (*DEFLECTION_COLUMNS, *ROTATION_COLUMNS)[:rows]


def coordinate_names(rows: int) -> tuple[str, ...]:
    """The same in words."""
    return ("change",) if rows == 1 else NAMES[:rows]
