"""Sheets of positions without the columns that nothing is known of."""

import re
from collections.abc import Sequence
from difflib import get_close_matches

from edtk.model.robot import Robot
from edtk.system.note import note
from edtk.tables.pose_columns import pose_columns, with_own_headers
from edtk.tables.pose_table import WRENCH_COLUMNS, PoseTable
from edtk.tables.sheet_columns import LOADED_COLUMNS, SHEET_COLUMNS

WIDE = re.compile(r"(\S*?[^\s_])_?[xyz]_mm")
LOAD = re.compile(r"[FTM][xyz](\W|_|$)", re.IGNORECASE)
ALIKE = 0.8  # of the letters of a header, from which it is taken for a misspelt one
MOST_NAMED = 6  # columns in a note


def without_strange(table: PoseTable, robot: Robot, known: Sequence[str]) -> PoseTable:
    """The table without columns that no part of a calibration reads, which a note names.

    Files of instruments have times, temperatures and points of their own. What may be a load, or a
    column that is missing under another name, stays and is refused where the table is read: without
    it numbers would be wrong in silence.

    Args:
        table: As it was read.
        robot: Names the joints.
        known: Columns that are read, besides those of joints and loads.
    """
    columns = (*pose_columns(robot), *WRENCH_COLUMNS, *known)
    written = [str(column) for column in table.cells]
    header = dict(zip(written, with_own_headers(written, robot, tuple(known)), strict=True))
    optional = set(SHEET_COLUMNS) - set(LOADED_COLUMNS)
    missing = [column for column in columns if column not in (*header.values(), *optional)]
    strange = [
        one
        for one, own in header.items()
        if own not in (*columns, *SHEET_COLUMNS)
        and not LOAD.match(one)
        and (WIDE.fullmatch(one) or not get_close_matches(one, missing, 1, ALIKE))
    ]
    if not strange:
        return table
    note(_words(strange), table.path)
    return table.without(strange)


def _words(strange: list[str]) -> str:
    """What is passed over, and how markers are named in a study."""
    of_markers = {column: match[1] for column in strange if (match := WIDE.fullmatch(column))}
    names = list(dict.fromkeys(of_markers.values()))
    others = [column for column in strange if column not in of_markers]
    parts = []
    if names:
        parts.append(unknown_markers(names))
    if others:
        more = len(others) - MOST_NAMED
        listed = ", ".join(others[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
        parts.append(f"column{'s' * (len(others) > 1)} {listed} not used")
    return "; ".join(parts)


def unknown_markers(names: Sequence[str]) -> str:
    """That positions of some markers do not count, and what would make them count."""
    more = len(names) - MOST_NAMED
    listed = ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
    return (
        f"positions of {listed} not used, as the study has no such marker; a [[marker]] with name "
        f'= "{names[0]}" (and joint = "base" if it stands on the base) would count'
    )
