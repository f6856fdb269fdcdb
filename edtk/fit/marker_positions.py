"""Measured positions of markers, a visit of a pose at a time, and how sheets of them are read."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cached_property

import numpy as np

from edtk.fit.correlated_noise import occurrence, row_numbers
from edtk.fit.same_poses import SamePoses
from edtk.fit.sheet import (
    QUATERNION,
    VECTOR,
    Form,
    Readings,
    Reference,
    form_of,
    has_any,
    read_turns,
    require_loads,
    sheet_instruments,
)
from edtk.measure.measured_model import ROWS_OF, Kind
from edtk.measure.pose_table import (
    DEFLECTION_COLUMNS,
    LOAD_COLUMNS,
    LOADED_COLUMNS,
    MARKER_NAME_COLUMN,
    MISSPELT,
    ROTATION_COLUMNS,
    SHEET_COLUMNS,
    VISIT_COLUMN,
    WRENCH_COLUMNS,
    PoseTable,
    Table,
    pose_columns,
    with_own_headers,
)
from edtk.robots.frames import all_wrenches
from edtk.robots.robot import Robot
from edtk.robots.rotations import rotation
from edtk.system.errors import note
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices, Mask

LOST = 1e-9  # [m] a position as near to the instrument's origin is a lost beam
MOST_NAMED = 6  # columns in a note
POSE_COLUMN = "pose"  # a number for people
COORDINATE = re.compile(r"(\S*?[^\s_])_?[xyz]_mm")
X_COORDINATE = re.compile(r"(\S*?[^\s_])_?x_mm")
NO_LOAD = np.zeros(6)
LOAD = re.compile(r"[FTM][xyz](\W|_|$)", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class MarkerPositions(Presented):
    """What k instruments read in v visits: positions as a rule; NaN where nothing was seen.

    Attributes:
        q: Joint variables (v, n) [rad or m].
        wrench: Forces and torques (v, 6) at the load point [N, N m]; zero where nothing loads.
        measured: Positions (v, k, 3) in the frame of the instrument [m], or in visits that are
            differences their change under the load; a distance stands in the first coordinate.
        row: Row of the file (v, k) that holds each, counted from 0; -1 where there is none.
        markers: Names (k,).
        turns: Orientations (v, k, 3, 3) there, where they were measured with the positions; NaN
            where nothing was seen. Where the visit is a difference, the turn under the load.
        differs: Which visits (v,) are differences of a loaded and an unloaded reading; None where
            all are absolute.
        kinds: What is read of each (k,); by default positions, or poses where there are turns.
        readings: Of how many readings (v, k) each is the mean; None for one.
    """

    q: Array
    wrench: Array
    measured: Array
    row: Indices
    markers: tuple[str, ...]
    turns: Array | None = None
    differs: Mask | None = None
    kinds: tuple[Kind, ...] = ()
    readings: Indices | None = None

    def __len__(self) -> int:
        return len(self.q)

    def __getitem__(self, chosen: Indices | slice | Mask) -> "MarkerPositions":
        """Some of the visits."""
        names = ["q", "wrench", "measured", "row"]
        others = ("turns", "differs", "readings")
        names += [name for name in others if getattr(self, name) is not None]
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})

    def of_markers(self, chosen: Indices | list[int] | slice) -> "MarkerPositions":
        """Some of the markers, in their order."""
        order = np.arange(len(self.markers))[chosen]
        return replace(
            self,
            measured=self.measured[:, order],
            row=self.row[:, order],
            markers=tuple(self.markers[i] for i in order),
            turns=None if self.turns is None else self.turns[:, order],
            kinds=tuple(self.kinds[i] for i in order) if self.kinds else (),
            readings=None if self.readings is None else self.readings[:, order],
        )

    @property
    def rows(self) -> int:
        """Rows of an instrument: three, or six where orientations are measured."""
        return 3 if self.turns is None else 6

    @cached_property
    def present(self) -> Mask:
        """Which of these (k, rows) each instrument reads."""
        if not self.kinds:
            return np.ones((len(self.markers), self.rows), dtype=bool)
        count = np.array([ROWS_OF[kind] for kind in self.kinds])
        return np.arange(self.rows) < count[:, None]

    def with_visits(self, others: "MarkerPositions") -> "MarkerPositions":
        """The visits, then others of the same markers."""
        differs = np.concatenate([self.is_difference, others.is_difference])
        turns = None
        if self.turns is not None and others.turns is not None:
            turns = np.concatenate([self.turns, others.turns])
        return replace(
            self,
            q=np.concatenate([self.q, others.q]),
            wrench=all_wrenches(self.wrench, others.wrench),
            measured=np.concatenate([self.measured, others.measured]),
            row=np.concatenate([self.row, others.row]),
            turns=turns,
            differs=differs if differs.any() else None,
            readings=_all_readings(self, others, axis=0),
        )

    def with_markers(self, others: "MarkerPositions") -> "MarkerPositions":
        """The same visits with other instruments too, after these."""
        turns = None
        if self.turns is not None and others.turns is not None:
            turns = np.concatenate([self.turns, others.turns], axis=1)
        usual: Kind = "position" if self.turns is None else "pose"
        return replace(
            self,
            measured=np.concatenate([self.measured, others.measured], axis=1),
            row=np.concatenate([self.row, others.row], axis=1),
            markers=(*self.markers, *others.markers),
            turns=turns,
            kinds=(*(self.kinds or (usual,) * len(self.markers)), *others.kinds),
            readings=_all_readings(self, others, axis=1),
        )

    @cached_property
    def is_difference(self) -> Mask:
        """Which visits (v,) are differences of two readings."""
        return np.zeros(len(self), dtype=bool) if self.differs is None else self.differs

    @property
    def absolute(self) -> "MarkerPositions":
        """The visits that are read absolutely."""
        return self if self.differs is None else self[~self.differs]

    def headline(self) -> str:
        """How many positions in how many poses."""
        return (
            f"{self.count} positions of {len(self.markers)} markers in {self.poses} poses, "
            f"{len(self)} visits"
        )

    @cached_property
    def seen(self) -> Mask:
        """Which markers (v, k) were seen."""
        return np.asarray((np.isfinite(self.measured) | ~self.present[:, :3]).all(axis=-1))

    @cached_property
    def often(self) -> Indices:
        """Of how many readings (v, k) each is the mean; zero where nothing was seen."""
        return self.seen * (1 if self.readings is None else self.readings)

    @cached_property
    def rows_seen(self) -> Mask:
        """Which rows (v, k, rows) were read."""
        return np.asarray(self.seen[..., None] & self.present)

    @cached_property
    def lost(self) -> Mask:
        """Which markers (v, k) are at the instrument's origin, where no beam has reached them."""
        size = np.abs(np.where(self.rows_seen[..., :3], self.measured, 0.0)).max(axis=-1)
        return np.asarray(self.seen & (size < LOST) & ~self.is_difference[:, None])

    def without_lost(self) -> "MarkerPositions":
        """The positions without those of lost beams."""
        return replace(self, measured=np.where(self.lost[..., None], np.nan, self.measured))

    @property
    def count(self) -> int:
        """Number of positions."""
        return int(self.seen.sum())

    @cached_property
    def pose(self) -> Indices:
        """Number (v,) of each visit's pose and load, counted from 0 in order of appearance.

        Differences count apart from absolute readings of the same pose and load.
        """
        return row_numbers(self.q, self.wrench, self.is_difference[:, None].astype(float))

    @cached_property
    def poses(self) -> int:
        """Number of poses, each under its load."""
        return int(self.pose.max(initial=-1)) + 1

    @cached_property
    def counts(self) -> Indices:
        """How many readings of each marker there are in each pose (poses, k)."""
        found = np.zeros((self.poses, len(self.markers)), dtype=int)
        np.add.at(found, self.pose, self.often)
        return found

    @cached_property
    def same_poses(self) -> SamePoses:
        """Which visits are of one pose, and their rows as independent ones."""
        each = (self.often[..., None] * self.present).astype(float)
        loaded = np.asarray(self.wrench.any(axis=1))
        return SamePoses.of(self.q, each, self.is_difference, loaded)

    @cached_property
    def means(self) -> "MarkerPositions":
        """The mean of the visits of each pose, a visit a pose."""
        total = np.zeros((self.poses, len(self.markers), 3))
        each = self.often[..., None] * self.measured
        np.add.at(total, self.pose, np.where(self.seen[..., None], each, 0.0))
        with np.errstate(invalid="ignore"):
            mean = total / self.counts[..., None]
        _, first = np.unique(self.pose, return_index=True)
        return MarkerPositions(
            self.q[first],
            self.wrench[first],
            mean,
            self.row[first],
            self.markers,
            None if self.turns is None else self._mean_turns(self.turns),
            None if self.differs is None else self.differs[first],
            self.kinds,
            self.counts,
        )

    def _mean_turns(self, turns: Array) -> Array:
        """The rotations (poses, k, 3, 3) nearest to the sums of those of the visits."""
        total = np.zeros((self.poses, len(self.markers), 3, 3))
        turned = self.rows_seen[..., 3]
        each = self.often[..., None, None] * turns
        np.add.at(total, self.pose, np.where(turned[..., None, None], each, 0.0))
        unseen = ((self.counts == 0) | ~self.present[:, 3])[..., None, None]
        U, _, Vt = np.linalg.svd(np.where(unseen, np.eye(3), total))
        sign = np.ones((*unseen.shape[:2], 3))
        sign[..., 2] = np.linalg.det(U @ Vt)
        return np.where(unseen, np.nan, (U * sign[..., None, :]) @ Vt)

    def rows_of_pose(self, pose: int) -> list[int]:
        """Rows of the file that a pose is in, counted from 0."""
        rows = self.row[self.pose == pose]
        return sorted(set(rows[rows >= 0].tolist()))


def _all_readings(some: MarkerPositions, others: MarkerPositions, axis: int) -> Indices | None:
    """Readings of all visits, or of all instruments; None where each is one."""
    both = [some, others]
    if all(one.readings is None for one in both):
        return None
    once = (np.ones_like(one.row) if one.readings is None else one.readings for one in both)
    return np.concatenate(list(once), axis=axis)


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
        and (COORDINATE.fullmatch(one) or not get_close_matches(one, missing, 1, MISSPELT))
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


def read_positions(
    path: Table,
    robot: Robot,
    fixed: dict[int, float],
    kinds: Mapping[str, Kind],
    measured: bool = True,
    others: Sequence[str] = (),
    load: Array | None = None,
    reference: Reference = "instrument",
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
        kinds: What is read of each marker and distance, by name; where there are none, positions
            of the markers that the sheet names.
        measured: Whether there have to be positions; without them all markers are in every row.
        others: Names of markers that the sheet may have besides, and that are passed over.
        load: The load (6,) of differences in a sheet that has no columns of loads; None for none.
        reference: What readings are counted from: differences may be from the nominal robot.

    Raises:
        PoseFileError: The file cannot be read; names the row or column.
    """
    table = PoseTable.read(path, "sheet")
    found = _names_in(table, robot)
    kinds = kinds or dict.fromkeys(found, "position")
    turned = [name for name, kind in kinds.items() if kind == "pose"]
    wide = {name: form for name, kind in kinds.items() if (form := _wide(table, name, kind))}
    if measured and not wide and found and MARKER_NAME_COLUMN not in table:
        _require_same(table, found, tuple(kinds))
    own = [*_columns(map(form_of, ("position", *kinds.values()))), MARKER_NAME_COLUMN]
    changes = [one for name in turned for one in _change_of(table, name)]
    needed = measured and not has_any(table, changes)
    of_turns = turn_columns(table, turned, pose_columns(robot), needed)
    turns = [*changes, *(column for columns in of_turns.values() for column in columns)]
    known = (*_columns(wide.values()), *own, VISIT_COLUMN, POSE_COLUMN, *turns)
    beside = _columns(form for name in others if (form := _wide(table, name, "position")))
    table = table.without([column for column in beside if column not in known])
    table = without_strange(table, robot, known).with_known(robot, known)
    if wide or (not measured and not has_any(table, own)):
        rows = _by_pose(table, robot, kinds, wide, reference)
    else:
        rows = _by_marker(table, robot, kinds, others, measured, reference)
    data = rows.visits(table, table.poses(robot, fixed), rows.loads(table, load))
    if not turned or not (wide or has_any(table, own)):
        return data
    return _with_turns(table, data, {name: of_turns.get(name, VECTOR) for name in turned})


def _columns(forms: Iterable[Form]) -> list[str]:
    """All columns of some forms, each once."""
    return list(dict.fromkeys(column for form in forms for column in form.columns))


def _wide(table: PoseTable, name: str, kind: Kind) -> Form | None:
    """The columns of one marker in a sheet with a pose a row; None where it has no such columns."""
    forms = (form_of(kind).of(before) for before in (name, f"{name}_"))
    return next((form for form in forms if has_any(table, form.columns)), None)


@dataclass(frozen=True, eq=False)
class _Rows:
    """Readings of markers, one a row.

    Attributes:
        kinds: What is read of each marker (k,), by name.
        row: Row of the file (r,) that each is in.
        index: Its marker (r,).
        read: What it is.
        visit: Number (r,) of its visit in its pose; None where repetitions are visits.
    """

    kinds: Mapping[str, Kind]
    row: Indices
    index: Indices
    read: Readings
    visit: Array | None

    def loads(self, table: PoseTable, load: Array | None) -> Array:
        """The load (r, 6) of each reading [N, N m].

        Args:
            table: The sheet.
            load: That of changes in a sheet without columns of loads; None for none.

        Raises:
            PoseFileError: A change is under none.
        """
        wrench = table.wrenches(NO_LOAD)
        differs = np.zeros((len(table), 1), dtype=bool)
        differs[self.row[self.read.differs]] = True
        loaded = wrench
        if load is not None and not has_any(table, WRENCH_COLUMNS):
            loaded = np.where(differs, load, wrench)
        require_loads(table, loaded, differs[:, 0])
        return np.where(self.read.differs[:, None], loaded[self.row], wrench[self.row])

    def visits(self, table: PoseTable, q: Array, wrench: Array) -> MarkerPositions:
        """The visits in order of appearance, absolute readings before changes.

        Args:
            table: The sheet.
            q: The pose of each of its rows [rad or m].
            wrench: The load of each reading [N, N m].

        Raises:
            PoseFileError: A marker is twice in a visit.
        """
        differs = self.read.differs
        places = np.column_stack([q[self.row], wrench, differs])
        repeats = occurrence(row_numbers(places, self.index[:, None]))
        number = repeats if self.visit is None else self.visit
        order = np.lexsort([differs, self.row])
        visit = np.empty(len(order), dtype=int)
        visit[order] = row_numbers(places[order], number[order, None])
        twice = np.flatnonzero(occurrence(row_numbers(visit[:, None], self.index[:, None])))
        if len(twice):
            raise table.error("the marker is twice in this visit", f"row {self.row[twice[0]] + 1}")
        first = np.unique(visit, return_index=True)[1]
        measured = np.full((len(first), len(self.kinds), 3), np.nan)
        row = np.full(measured.shape[:2], -1)
        measured[visit, self.index] = self.read.value
        row[visit, self.index] = self.row
        kinds = tuple(self.kinds.values())
        alike = len(set(kinds)) == 1 and "distance" not in kinds  # which shows by itself
        return MarkerPositions(
            q[self.row[first]],
            wrench[first],
            measured,
            row,
            tuple(self.kinds),
            differs=differs[first] if differs.any() else None,
            kinds=() if alike else kinds,
        )


def _by_pose(
    table: PoseTable,
    robot: Robot,
    kinds: Mapping[str, Kind],
    wide: Mapping[str, Form],
    reference: Reference,
) -> _Rows:
    """A sheet with a pose a row, which is a visit; one with a position and a change is of two.

    Without any columns all markers are in every row.
    """
    names = list(kinds)
    every = [Readings.of_one(table, form, robot.reach, reference) for form in wide.values()]
    every = every or [Readings.nothing(len(table))] * len(names)
    index = [names.index(name) for name in wide or names]
    differs = np.stack([one.differs for one in every], axis=1)
    value = np.stack([one.value for one in every], axis=1)
    absolute = np.isfinite(value[..., 0]) & ~differs
    # What was not seen is of an absolute visit if there is one.
    kept = differs | absolute | absolute.any(axis=1, keepdims=True)
    kept |= ~differs.any(axis=1, keepdims=True)
    row, column = np.nonzero(kept)
    read = Readings(value[kept], np.full_like(value[kept], np.nan), differs[kept])
    return _Rows(kinds, row, np.array(index)[column], read, row.astype(float))


def _by_marker(
    table: PoseTable,
    robot: Robot,
    kinds: Mapping[str, Kind],
    others: Sequence[str],
    measured: bool,
    reference: Reference,
) -> _Rows:
    """A sheet with a marker a row; rows of others than those of the study are passed over."""
    names = tuple(kinds)
    or_else = f", or a row a pose with {names[0]}x_mm and so on"
    index, strange = sheet_instruments(table, names, or_else, others)
    if strange:
        note(unknown_markers(strange), table.path)
    read = Readings.of(
        table,
        tuple(kinds.values()),
        index,
        robot.reach,
        reference,
        blank=True,
        needed=measured,
    )
    row = np.flatnonzero(index >= 0)
    visit = table.numbers(VISIT_COLUMN)[row] if VISIT_COLUMN in table else None
    return _Rows(kinds, row, index[row], read[row], visit)


def _with_turns(
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
            (seen & data.is_difference, _change_of(table, name)),
        ):
            if visits.any():
                vectors = read_turns(table, data.row[visits, marker], written)
                turns[visits, marker] = rotation(vectors)
    return replace(data, turns=turns)


def _change_of(table: PoseTable, name: str) -> tuple[str, ...]:
    """The columns of a turn by a load: with the marker's name where a sheet has a pose a row.

    Those of a sheet with a marker a row have none.
    """
    for before in (name, f"{name}_"):
        named = tuple(f"{before}{column}" for column in ROTATION_COLUMNS)
        if has_any(table, named):
            return named
    return ROTATION_COLUMNS


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
