"""Sheets of positions: whose columns they are, and what each row says of which visit."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches

import numpy as np

from edtk.fit.geometry.marker_positions import MarkerPositions
from edtk.measure.measured_model import Kind
from edtk.measure.pose_table import (
    AFTER_COLUMN,
    BEFORE_COLUMN,
    CHANGE_COLUMN,
    DEFLECTION_COLUMNS,
    DISTANCE_COLUMN,
    LOAD_COLUMNS,
    LOADED_COLUMNS,
    MARKER_NAME_COLUMN,
    ROTATION_COLUMNS,
    SHEET_COLUMNS,
    UNLOADED_COLUMNS,
    VISIT_COLUMN,
    WRENCH_COLUMNS,
    PoseTable,
    Table,
    pose_columns,
    with_own_headers,
)
from edtk.robots.robot import Robot
from edtk.system.errors import note
from edtk.system.typing import Array, Indices, Mask

ALIKE = 0.8  # of the letters of a header, from which it is taken for a misspelt one
MOST_NAMED = 6  # columns in a note
VECTOR = ("rx_deg", "ry_deg", "rz_deg")
QUATERNION = ("qw", "qx", "qy", "qz")
UNIT = 0.01  # by how much the length of a quaternion may differ from one
POSE_COLUMN = "pose"  # a number for people
COORDINATE = re.compile(r"(\S*?[^\s_])_?[xyz]_mm")
LOAD = re.compile(r"[FTM][xyz](\W|_|$)", re.IGNORECASE)


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
    columns = (*pose_columns(robot), *WRENCH_COLUMNS, *LOAD_COLUMNS, *known)
    written = [str(column) for column in table.cells]
    header = dict(zip(written, with_own_headers(written, robot, tuple(known)), strict=True))
    optional = set(SHEET_COLUMNS) - set(LOADED_COLUMNS)
    missing = [column for column in columns if column not in (*header.values(), *optional)]
    strange = [
        one
        for one, own in header.items()
        if own not in (*columns, *SHEET_COLUMNS)
        and not LOAD.match(one)
        and (COORDINATE.fullmatch(one) or not get_close_matches(one, missing, 1, ALIKE))
    ]
    if not strange:
        return table
    note(_words(strange), table.path)
    return table.without(strange)


def _words(strange: list[str]) -> str:
    """What is passed over, and how markers are named in a study."""
    of_markers = {column: match[1] for column in strange if (match := COORDINATE.fullmatch(column))}
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


def turn_columns(
    table: PoseTable, names: Sequence[str], joints: Sequence[str], measured: bool = True
) -> dict[str, tuple[str, ...]]:
    """The columns of the orientation of each marker, in the frame of the instrument.

    These are a rotation vector, the axis times the angle in degrees, `rx_deg ry_deg rz_deg`; or a
    quaternion `qw qx qy qz`. In a sheet with a pose a row the marker's name stands before them, as
    before its position; in one with a marker a row nothing does.

    Args:
        table: The sheet.
        names: Markers whose orientations are measured.
        joints: Columns of the joints, which are no orientations: one may be called rx.
        measured: Whether there have to be any.

    Raises:
        PoseFileError: A marker has no such columns.
    """
    found = {}
    for name in names:
        forms = [
            tuple(f"{before}{column}" for column in columns)
            for before in (name, f"{name}_", "")
            for columns in (VECTOR, QUATERNION)
        ]
        there = [
            form
            for form in forms
            if all(column in table and column not in joints for column in form)
        ]
        if there:
            found[name] = there[0]
        elif measured:
            raise table.error(
                f"no orientation of {name}; expected {', '.join(forms[0])} (axis times angle), or "
                f"{', '.join(forms[1])}, as measurement.rows is 'pose'"
            )
    return found


def with_turns(
    table: PoseTable, data: MarkerPositions, columns: Mapping[str, tuple[str, ...]]
) -> MarkerPositions:
    """The positions with the orientations that the sheet has beside them.

    Beside a change of a position stands the turn under the load, `drx_deg dry_deg drz_deg`.

    Raises:
        PoseFileError: A cell is no number, or empty beside a position; or a quaternion is none.
    """
    turns = np.full((*data.seen.shape, 3, 3), np.nan)
    for name, own in columns.items():
        marker = data.markers.index(name)
        seen = data.seen[:, marker]
        for visits, written in (
            (seen & ~data.is_difference, own),
            (seen & data.is_difference, _change_of(table, name, ROTATION_COLUMNS)),
        ):
            if visits.any():
                turns[visits, marker] = _turns(table, data.row[visits, marker], written)
    return replace(data, turns=turns)


def _turns(table: PoseTable, rows: Indices, own: tuple[str, ...]) -> Array:
    """The rotations (m, 3, 3) in some rows of a sheet."""
    missing = [column for column in own if column not in table]
    if missing:
        raise table.error(
            f"column {missing[0]!r} is missing; expected {', '.join(own)}, as measurement.rows is "
            "'pose'"
        )
    filled: Mask = np.zeros(len(table), dtype=bool)
    filled[rows] = True
    if set(own) <= {*VECTOR, *QUATERNION, *ROTATION_COLUMNS}:
        filled = table.filled(own)  # rows of other markers have theirs in the same columns
        blank = rows[~filled[rows]]
        if len(blank):
            raise table.error("a position without an orientation", f"row {blank[0] + 1}")
    return _matrices(table, table.of_rows(filled).vectors(own)[rows], rows)


def _change_of(table: PoseTable, name: str, columns: tuple[str, ...]) -> tuple[str, ...]:
    """The columns of a change: with the marker's name before them, as in a sheet with a pose a row.

    Those of a sheet with a marker a row have none.
    """
    for before in (name, f"{name}_"):
        named = tuple(f"{before}{column}" for column in columns)
        if any(column in table for column in named):
            return named
    return columns


def _matrices(table: PoseTable, values: Array, rows: Indices) -> Array:
    """Rotations (m, 3, 3) of vectors [deg] or quaternions, scalar first."""
    from scipy.spatial.transform import Rotation

    if values.shape[1] == len(VECTOR):
        return np.asarray(Rotation.from_rotvec(np.deg2rad(values)).as_matrix())
    length = np.linalg.norm(values, axis=1)
    wrong = np.flatnonzero(np.abs(length - 1) > UNIT)
    if len(wrong):
        raise table.error(
            f"a quaternion of length {length[wrong[0]]:.4g}; expected one of length 1",
            f"row {rows[wrong[0]] + 1}",
        )
    return np.asarray(Rotation.from_quat(np.roll(values, -1, axis=1)).as_matrix())


# Columns of a distance: its change, and what it was before and after that.
DISTANCES = ((CHANGE_COLUMN,), (BEFORE_COLUMN,), (AFTER_COLUMN,))
X_COORDINATE = re.compile(r"(\S*?[^\s_])_?x_mm")
NO_LOAD = np.zeros(6)


def read_positions(
    path: Table,
    robot: Robot,
    fixed: dict[int, float],
    markers: Sequence[str],
    measured: bool = True,
    others: Sequence[str] = (),
    turned: Sequence[str] = (),
    load: Array | None = None,
    distances: Sequence[str] = (),
) -> MarkerPositions:
    """Read a sheet of positions, and of distances.

    A row is a marker, `x_mm y_mm z_mm` with its name in the column `marker` (which one marker alone
    does not need); or a row is a pose, with columns `NAMEx_mm NAMEy_mm NAMEz_mm` (or `NAME_x_mm`)
    for each marker. A marker whose three cells are empty was not seen. Loads are forces and torques
    as in a plan, zero by default. Readings of one visit have the same number in the column `visit`;
    without it each repetition of a marker is a visit of its own. Columns and markers that nothing
    is known of are passed over, with a note. For orientations see `turn_columns`.

    A row with `dx_mm dy_mm dz_mm`, or with the unloaded position `x0_mm y0_mm z0_mm` beside the
    loaded one, is the difference of two readings, in the axes of the instrument. Others are
    absolute; one sheet may have both. A row of a distance has `distance_mm`, or where it is a
    difference `change_mm`, or `before_mm after_mm`.

    Args:
        path: The CSV file, or a data frame that holds what it would.
        robot: Names the joints.
        fixed: Values [rad or m] of joints, by index, that the file may leave out.
        markers: Names of the markers (k,); where there are none, those of the sheet count.
        measured: Whether there have to be positions; without them all markers are in every row.
        others: Names of markers that the sheet may have besides, and that are passed over.
        turned: Names of the markers whose orientations are measured, too.
        load: The load (6,) of differences in a sheet that has no columns of loads; None for none.
        distances: Names of those of the markers that are distances.

    Raises:
        PoseFileError: The file cannot be read; names the row or column.
    """
    table = PoseTable.read(path, "sheet")
    found = _names_in(table, robot)
    markers = markers or found
    kinds = tuple(_kind(name, turned, distances) for name in markers)
    pairs = list(zip(markers, kinds, strict=True))
    own = tuple(column for name, kind in pairs for column in _wide(table, name, kind))
    if measured and not own and found and MARKER_NAME_COLUMN not in table:
        _require_same(table, found, markers)
    plain: tuple[str, ...] = (
        *LOADED_COLUMNS,
        MARKER_NAME_COLUMN,
        *UNLOADED_COLUMNS,
        *DEFLECTION_COLUMNS,
    )
    plain += (DISTANCE_COLUMN, *(c for form in DISTANCES for c in form)) if distances else ()
    changes = tuple(
        column for name in turned for column in _change_of(table, name, ROTATION_COLUMNS)
    )
    needed = measured and not any(column in table for column in changes)
    of_turns = turn_columns(table, turned, pose_columns(robot), needed)
    turns = (*changes, *(column for columns in of_turns.values() for column in columns))
    of_turns = {name: of_turns.get(name, VECTOR) for name in turned}
    known = (*own, *plain, VISIT_COLUMN, POSE_COLUMN, *turns)
    beside = tuple(column for name in others for column in _wide(table, name, "position"))
    table = table.without([column for column in beside if column not in known])
    table = without_strange(table, robot, known).with_known(robot, known)
    q = table.poses(robot, fixed)
    wrench = table.wrenches(NO_LOAD)
    if own:
        positions = _by_pose(table, q, wrench, pairs)
    elif not measured and not any(column in table for column in plain):
        nothing = np.full((len(q), len(markers), 3), np.nan)
        row = np.repeat(np.arange(len(q))[:, None], len(markers), axis=1)
        return MarkerPositions(q, wrench, nothing, row, tuple(markers), kinds=_stated(kinds))
    else:
        positions = _by_marker(table, q, wrench, (pairs, tuple(others)), measured)
    positions = replace(positions, kinds=_stated(kinds))
    if positions.differs is not None:
        positions = _loaded(table, positions, load)
    return with_turns(table, positions, of_turns) if turned else positions


def _kind(name: str, turned: Sequence[str], distances: Sequence[str]) -> Kind:
    """What is read of an instrument."""
    return "pose" if name in turned else "distance" if name in distances else "position"


def _stated(kinds: tuple[Kind, ...]) -> tuple[Kind, ...]:
    """The kinds of instruments; none where all are the same, and show by themselves what it is."""
    return () if len(set(kinds)) == 1 and "distance" not in kinds else kinds


def _loaded(table: PoseTable, data: MarkerPositions, load: Array | None) -> MarkerPositions:
    """The visits, of which differences are under a load.

    Raises:
        PoseFileError: One is under none.
    """
    if load is not None and not any(column in table for column in WRENCH_COLUMNS):
        data = replace(data, wrench=np.where(data.is_difference[:, None], load, data.wrench))
    unloaded = np.flatnonzero(data.is_difference & ~data.wrench.any(axis=1))
    if len(unloaded):
        row = int(data.row[unloaded[0]].max()) + 1
        raise table.error(
            "a displacement without a load; expected the load that made it", f"row {row}"
        )
    return data


def _names_in(table: PoseTable, robot: Robot) -> tuple[str, ...]:
    """The markers that a sheet names, in their order; one without a name where it names none."""
    if MARKER_NAME_COLUMN in table:
        return tuple(dict.fromkeys(table.texts(MARKER_NAME_COLUMN)))
    joints = pose_columns(robot)
    others = (str(column) for column in table.cells if column not in joints)
    found = (X_COORDINATE.fullmatch(column) for column in others)
    names = (
        match[1].removesuffix("_d")
        for match in found
        if match and match[0] != DEFLECTION_COLUMNS[0]
    )
    return tuple(dict.fromkeys(names)) or (MARKER_NAME_COLUMN,)


def _forms(table: PoseTable, before: str, kind: Kind) -> tuple[tuple[str, ...], ...]:
    """Columns of an instrument, with its name before them: readings, unloaded ones, and changes."""
    own: tuple[tuple[str, ...], ...] = (LOADED_COLUMNS, UNLOADED_COLUMNS, DEFLECTION_COLUMNS)
    if kind == "distance":
        changes, first, after = DISTANCES
        whole = after if f"{before}{after[0]}" in table else (DISTANCE_COLUMN,)
        own = (whole, first, changes)
    return tuple(tuple(f"{before}{column}" for column in columns) for columns in own)


def _before(table: PoseTable, name: str, kind: Kind) -> str | None:
    """What stands before the columns of one marker in a sheet with a pose a row; None without."""
    for before in (name, f"{name}_"):
        if any(column in table for columns in _forms(table, before, kind) for column in columns):
            return before
    return None


def _wide(table: PoseTable, name: str, kind: Kind) -> tuple[str, ...]:
    """The columns of one marker in a sheet with a pose a row; none where it has no such columns."""
    before = _before(table, name, kind)
    if before is None:
        return ()
    forms = _forms(table, before, kind)
    has = (any(column in table for column in columns) for columns in forms)
    return tuple(c for columns, there in zip(forms, has, strict=True) if there for c in columns)


def _by_pose(
    table: PoseTable, q: Array, wrench: Array, instruments: Sequence[tuple[str, Kind]]
) -> MarkerPositions:
    """A sheet with a pose a row; one with a position and a change is of two visits."""
    markers = [name for name, _ in instruments]
    found = np.full((len(q), len(markers), 3), np.nan)
    row = np.full((len(q), len(markers)), -1)
    differs = np.zeros(row.shape, dtype=bool)
    for i, (name, kind) in enumerate(instruments):
        before = _before(table, name, kind)
        if before is not None:
            found[:, i], differs[:, i] = _readings(table, _forms(table, before, kind))
            row[:, i] = np.arange(len(q))
    if not differs.any():
        return MarkerPositions(q, wrench, found, row, tuple(markers))
    absolute = np.isfinite(found[..., 0]) & ~differs
    first = np.flatnonzero(absolute.any(axis=1) | ~differs.any(axis=1))
    second = np.flatnonzero(differs.any(axis=1))
    visit = np.concatenate([first, second])
    is_change = np.repeat([False, True], [len(first), len(second)])
    order = np.argsort(visit, kind="stable")
    visit, is_change = visit[order], is_change[order]
    own = differs[visit] == is_change[:, None]
    return MarkerPositions(
        q[visit],
        wrench[visit],
        np.where(own[..., None], found[visit], np.nan),
        np.where(own, row[visit], -1),
        tuple(markers),
        differs=is_change,
    )


def _by_marker(
    table: PoseTable,
    q: Array,
    wrench: Array,
    names: tuple[Sequence[tuple[str, Kind]], tuple[str, ...]],
    measured: bool,
) -> MarkerPositions:
    """A sheet with a marker a row; rows of others than the first names are passed over."""
    instruments, others = names
    markers = tuple(name for name, _ in instruments)
    index = _markers(table, markers, others)
    x = np.full((len(q), 3), np.nan)
    differs = np.zeros(len(q), dtype=bool)
    is_distance = np.array([kind == "distance" for _, kind in instruments])
    every: tuple[tuple[Kind, Mask], ...] = (
        ("position", (index < 0) | ~is_distance[index]),
        ("distance", (index >= 0) & is_distance[index]),
    )
    for kind, own in every:
        forms = _forms(table, "", kind)
        stated = any(column in table for columns in forms for column in columns)
        if own.any() and (measured or stated):
            read, are_changes = _readings(table, forms)
            x[own], differs[own] = read[own], are_changes[own]
    rows = np.flatnonzero(index >= 0)
    q, wrench, x, index, differs = q[rows], wrench[rows], x[rows], index[rows], differs[rows]
    visit = _visits(table, np.column_stack([q, wrench, differs]), index, rows)
    count = int(visit.max(initial=-1)) + 1
    found = np.full((count, len(markers), 3), np.nan)
    row = np.full((count, len(markers)), -1)
    first = np.array([int(np.argmax(visit == one)) for one in range(count)], dtype=int)
    found[visit, index] = x
    row[visit, index] = rows
    is_change = differs[first] if differs.any() else None
    return MarkerPositions(q[first], wrench[first], found, row, markers, differs=is_change)


def _readings(table: PoseTable, forms: tuple[tuple[str, ...], ...]) -> tuple[Array, Mask]:
    """What a marker's columns say: positions or changes (m, 3) [m], and which are changes (m,).

    A distance is the first of the three, and the others are NaN.

    Args:
        table: The sheet.
        forms: Columns of positions, of unloaded positions, and of changes.

    Raises:
        PoseFileError: A row has a change and a position, or a cell is no number.
    """
    placed, _, changed = forms
    has = [any(column in table for column in columns) for columns in forms]
    if not has[1] and not has[2]:
        return _points(table, placed), np.zeros(len(table), dtype=bool)
    nothing = np.full((len(table), 3), np.nan)
    x, before, change = (
        _points(table, columns) if there else nothing
        for columns, there in zip(forms, has, strict=True)
    )
    is_placed, is_change = (np.isfinite(one[:, 0]) for one in (x, change))
    both = np.flatnonzero(is_placed & is_change)
    if len(both):
        raise table.error(
            f"a reading and a change; expected {', '.join(placed)}, or {', '.join(changed)}",
            f"row {both[0] + 1}",
        )
    differs = is_change | (is_placed & np.isfinite(before[:, 0]))
    return np.where(is_change[:, None], change, x - np.nan_to_num(before)), differs


def _points(table: PoseTable, columns: tuple[str, ...]) -> Array:
    """Points (m, 3) [m], or distances before two NaN; NaN where all cells are empty.

    Raises:
        PoseFileError: A cell is no number, or one of three is empty.
    """
    filled = table.filled(columns)
    points = table.of_rows(filled).vectors(columns) / 1e3
    found = np.full((len(points), 3), np.nan)
    found[filled, : len(columns)] = points[filled]
    return found


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
