"""Absolute positions of markers, from a file."""

import re
from collections.abc import Sequence

import numpy as np

from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.inference.geometry.turn_columns import turn_columns, with_turns
from edtk.inference.geometry.without_strange import unknown_markers, without_strange
from edtk.model.robot import Robot
from edtk.system.note import note
from edtk.system.typing import Array, Indices
from edtk.tables.pose_columns import pose_columns
from edtk.tables.pose_table import PoseTable, Table
from edtk.tables.sheet_columns import LOADED_COLUMNS, MARKER_NAME_COLUMN, VISIT_COLUMN

POSE_COLUMN = "pose"  # a number for people
WIDE = re.compile(r"(\S*?[^\s_])_?x_mm")
NO_LOAD = np.zeros(6)


def read_positions(
    path: Table,
    robot: Robot,
    fixed: dict[int, float],
    markers: Sequence[str],
    measured: bool = True,
    others: Sequence[str] = (),
    turned: Sequence[str] = (),
) -> MarkerPositions:
    """Read a sheet of positions.

    A row is a marker, `x_mm y_mm z_mm` with its name in the column `marker` (which one marker alone
    does not need); or a row is a pose, with columns `NAMEx_mm NAMEy_mm NAMEz_mm` (or `NAME_x_mm`)
    for each marker. A marker whose three cells are empty was not seen. Loads are forces and torques
    as in a plan, zero by default. Readings of one visit have the same number in the column `visit`;
    without it each repetition of a marker is a visit of its own. Columns and markers that nothing
    is known of are passed over, with a note. For orientations see `turn_columns`.

    Args:
        path: The CSV file, or a data frame that holds what it would.
        robot: Names the joints.
        fixed: Values [rad or m] of joints, by index, that the file may leave out.
        markers: Names of the markers (k,); where there are none, those of the sheet count.
        measured: Whether there have to be positions; without them all markers are in every row.
        others: Names of markers that the sheet may have besides, and that are passed over.
        turned: Names of the markers whose orientations are measured, too.

    Raises:
        PoseFileError: The file cannot be read; names the row or column.
    """
    table = PoseTable.read(path, "sheet")
    found = _names_in(table, robot)
    markers = markers or found
    wide = {name: _wide(table, name) for name in markers}
    own = tuple(column for columns in wide.values() for column in columns)
    if measured and not own and found and MARKER_NAME_COLUMN not in table:
        _require_same(table, found, markers)
    plain = (*LOADED_COLUMNS, MARKER_NAME_COLUMN)
    of_turns = turn_columns(table, turned, pose_columns(robot), measured)
    turns = tuple(column for columns in of_turns.values() for column in columns)
    known = (*own, *plain, VISIT_COLUMN, POSE_COLUMN, *turns)
    beside = tuple(column for name in others for column in _wide(table, name))
    table = table.without([column for column in beside if column not in known])
    table = without_strange(table, robot, known).with_known(robot, known)
    q = table.poses(robot, fixed)
    wrench = table.wrenches(NO_LOAD)
    if own:
        positions = _by_pose(table, q, wrench, wide)
        return with_turns(table, positions, of_turns) if turned else positions
    if not measured and not any(column in table for column in plain):
        nothing = np.full((len(q), len(markers), 3), np.nan)
        row = np.repeat(np.arange(len(q))[:, None], len(markers), axis=1)
        return MarkerPositions(q, wrench, nothing, row, tuple(markers))
    positions = _by_marker(table, q, wrench, (tuple(markers), tuple(others)), measured)
    return with_turns(table, positions, of_turns) if turned else positions


def _names_in(table: PoseTable, robot: Robot) -> tuple[str, ...]:
    """The markers that a sheet names, in their order; one without a name where it names none."""
    if MARKER_NAME_COLUMN in table:
        return tuple(dict.fromkeys(table.texts(MARKER_NAME_COLUMN)))
    joints = pose_columns(robot)
    others = (str(column) for column in table.cells if column not in joints)
    found = (WIDE.fullmatch(column) for column in others)
    names = (match[1] for match in found if match)
    return tuple(dict.fromkeys(names)) or (MARKER_NAME_COLUMN,)


def _wide(table: PoseTable, name: str) -> tuple[str, ...]:
    """The columns of one marker in a sheet with a pose a row; none where it has no such columns."""
    for form in ("{name}{axis}_mm", "{name}_{axis}_mm"):
        columns = tuple(form.format(name=name, axis=axis) for axis in "xyz")
        if any(column in table for column in columns):
            return columns
    return ()


def _by_pose(
    table: PoseTable, q: Array, wrench: Array, wide: dict[str, tuple[str, ...]]
) -> MarkerPositions:
    """A sheet with a pose a row."""
    found = np.full((len(q), len(wide), 3), np.nan)
    row = np.full((len(q), len(wide)), -1)
    for i, columns in enumerate(wide.values()):
        if columns:
            found[:, i] = _points(table, columns)
            row[:, i] = np.arange(len(q))
    return MarkerPositions(q, wrench, found, row, tuple(wide))


def _by_marker(
    table: PoseTable,
    q: Array,
    wrench: Array,
    names: tuple[tuple[str, ...], tuple[str, ...]],
    measured: bool,
) -> MarkerPositions:
    """A sheet with a marker a row; rows of others than the first names are passed over."""
    markers, others = names
    index = _markers(table, markers, others)
    x = np.full((len(q), 3), np.nan)
    if measured or any(column in table for column in LOADED_COLUMNS):
        x = _points(table, LOADED_COLUMNS)
    rows = np.flatnonzero(index >= 0)
    q, wrench, x, index = q[rows], wrench[rows], x[rows], index[rows]
    visit = _visits(table, np.hstack([q, wrench]), index, rows)
    count = int(visit.max(initial=-1)) + 1
    found = np.full((count, len(markers), 3), np.nan)
    row = np.full((count, len(markers)), -1)
    first = np.array([int(np.argmax(visit == one)) for one in range(count)], dtype=int)
    found[visit, index] = x
    row[visit, index] = rows
    return MarkerPositions(q[first], wrench[first], found, row, markers)


def _points(table: PoseTable, columns: tuple[str, ...]) -> Array:
    """Points (m, 3) [m]; NaN in rows where all three cells are empty, as of a lost beam.

    Raises:
        PoseFileError: A cell is no number, or one of three is empty.
    """
    filled = table.filled(columns)
    points = table.of_rows(filled).vectors(columns) / 1e3
    return np.where(filled[:, None], points, np.nan)


def _require_same(table: PoseTable, found: Sequence[str], markers: Sequence[str]) -> None:
    """Check that a sheet with a row a pose names a marker of the study.

    Raises:
        PoseFileError: It names others.
    """
    named = [name for name in found if name != MARKER_NAME_COLUMN]
    if named and not set(named) & set(markers):
        raise table.error(
            f"positions of {', '.join(named)}, and the study's markers are {', '.join(markers)}; "
            "expected the same names"
        )


def _markers(table: PoseTable, markers: tuple[str, ...], others: tuple[str, ...]) -> Indices:
    """Index (m,) of each row's marker, -1 for those that the study lacks.

    Raises:
        PoseFileError: The column is missing, or names no marker of the study.
    """
    if MARKER_NAME_COLUMN not in table:
        if len(markers) == 1:
            return np.zeros(len(table), dtype=int)
        raise table.error(
            f"column {MARKER_NAME_COLUMN!r} is missing; expected which of {', '.join(markers)} "
            f"each row is of, or a row a pose with {markers[0]}x_mm and so on"
        )
    given = table.texts(MARKER_NAME_COLUMN)
    strange = list(dict.fromkeys(name for name in given if name not in markers))
    if len(strange) == len(set(given)):
        raise table.error(
            f"no marker {strange[0]!r} in the study; expected one of {', '.join(markers)}",
            f"row 1, column {MARKER_NAME_COLUMN}",
        )
    strange = [name for name in strange if name not in others]
    if strange:
        note(unknown_markers(strange), table.path)
    return np.array([markers.index(name) if name in markers else -1 for name in given], dtype=int)


def _visits(table: PoseTable, places: Array, index: Indices, rows: Indices) -> Indices:
    """Number (m,) of each row's visit, counted from 0 in order of appearance.

    Args:
        table: The sheet.
        places: Pose and load (m, n + 6) of each row.
        index: Its marker (m,).
        rows: Its row (m,) in the file.

    Raises:
        PoseFileError: A marker is twice in a visit.
    """
    numbers = table.numbers(VISIT_COLUMN)[rows] if VISIT_COLUMN in table else None
    visits: dict[tuple[float, ...], int] = {}
    times: dict[tuple[float, ...], int] = {}
    found = np.zeros(len(places), dtype=int)
    for i, place in enumerate((places + 0.0).tolist()):
        own = (*place, float(index[i]))
        occurrence = float(times.get(own, 0))
        if numbers is not None:
            own = (*own, float(numbers[i]))
            occurrence = float(numbers[i])
            if own in times:
                raise table.error("the marker is twice in this visit", f"row {rows[i] + 1}")
        times[own] = times.get(own, 0) + 1
        found[i] = visits.setdefault((*place, occurrence), len(visits))
    return found
