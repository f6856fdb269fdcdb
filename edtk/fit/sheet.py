"""What a measurement sheet says: the instrument of each row, what it read, and how well."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from edtk.fit.correlated_noise import CorrelatedNoise, NotPositiveDefiniteError
from edtk.measure.cells import PoseFileError
from edtk.measure.instruments.sensor import Sensor
from edtk.measure.measured_model import Kind
from edtk.measure.pose_table import (
    AFTER_COLUMN,
    AXIS_SIGMA_COLUMNS,
    BEFORE_COLUMN,
    CHANGE_COLUMN,
    COVARIANCE_COLUMNS,
    DEFLECTION_COLUMNS,
    DISTANCE_COLUMN,
    LOADED_COLUMNS,
    MARKER_COLUMNS,
    MARKER_NAME_COLUMN,
    ROTATION_COLUMNS,
    SIGMA_COLUMN,
    TURN_COLUMN,
    UNLOADED_COLUMNS,
    PoseTable,
)
from edtk.system.typing import Array, Indices, Mask

# A marker that moves by more than this share of the robot's reach was not moved by its load.
FAR = 0.1
# Halfway, on a logarithmic scale, between positions in millimetres (1e3 times the reach in metres)
# and in micrometres (1e6 times). Larger ones have the wrong unit, which later checks name better
# than as swapped columns.
MICROMETRES = 3e4
# A standard deviation that anybody can mean; the square of a smaller one underflows.
LEAST_SIGMA_MM = 1e-9
UNIT = 0.01  # by how much the length of a quaternion may differ from one
# Places of the upper triangle in the order of the columns, and those of the variances.
ROWS = (0, 0, 0, 1, 1, 2)
COLUMNS = (0, 1, 2, 1, 2, 2)
# Orientations in the frame of the instrument: the axis times the angle, or a quaternion.
VECTOR = ("rx_deg", "ry_deg", "rz_deg")
QUATERNION = ("qw", "qx", "qy", "qz")

# What an instrument reads; a rotation is a single one, in a row of its own.
Read = Kind | Literal["rotation"]
# What readings are counted from: the unloaded robot, the nominal one, or the instrument's origin.
Reference = Literal["unloaded", "nominal", "instrument"]


@dataclass(frozen=True)
class Form:
    """The columns of one quantity.

    Attributes:
        kinds: What instruments read that have them.
        what: One reading in words.
        absolute: A reading in the frame of the instrument.
        loaded: A reading with the load, beside one without it.
        unloaded: The reading without it.
        change: The difference of both.
        per: Units of the columns in a metre or a radian.
    """

    kinds: tuple[Read, ...]
    what: str
    absolute: tuple[str, ...]
    loaded: tuple[str, ...]
    unloaded: tuple[str, ...]
    change: tuple[str, ...]
    per: float = 1e3

    def of(self, before: str) -> "Form":
        """With a name before all columns, as in a sheet with a pose a row."""

        def named(columns: tuple[str, ...]) -> tuple[str, ...]:
            return tuple(f"{before}{column}" for column in columns)

        return replace(
            self,
            absolute=named(self.absolute),
            loaded=named(self.loaded),
            unloaded=named(self.unloaded),
            change=named(self.change),
        )

    @property
    def columns(self) -> tuple[str, ...]:
        """All of them."""
        return (*self.absolute, *self.loaded, *self.unloaded, *self.change)

    def whole(self, table: PoseTable, reference: Reference) -> tuple[tuple[str, ...], ...]:
        """The columns of a reading that is no difference by itself; some rows may have others."""
        if reference == "unloaded":
            return (self.loaded,)
        either = dict.fromkeys((self.absolute, self.loaded))
        return tuple(one for one in either if has_any(table, one)) or (self.absolute,)

    def missing(self, table: PoseTable, reference: Reference) -> PoseFileError:
        """The error of a table that has none of them."""
        before = self.unloaded if reference == "unloaded" else ()
        differing = (self.change, (*before, *self.loaded))
        ways = (self.absolute,) if reference == "instrument" else differing
        expected = ", or ".join(", ".join(way) for way in ways if way)
        return table.error(f"column {ways[0][0]!r} is missing; expected {expected}")


POSITION = Form(
    ("position", "pose"),
    "a position",
    LOADED_COLUMNS,
    LOADED_COLUMNS,
    UNLOADED_COLUMNS,
    DEFLECTION_COLUMNS,
)
DISTANCE = Form(
    ("distance",),
    "a distance",
    (DISTANCE_COLUMN,),
    (AFTER_COLUMN,),
    (BEFORE_COLUMN,),
    (CHANGE_COLUMN,),
)
ROTATION = Form(("rotation",), "a single rotation", (), (), (), (TURN_COLUMN,), 180 / np.pi)
FORMS = (POSITION, DISTANCE, ROTATION)
# What an instrument of so many rows reads.
BY_ROWS: dict[int, Read] = {1: "distance", 3: "position", 6: "pose"}


def form_of(kind: Read) -> Form:
    """The columns of an instrument."""
    return next(form for form in FORMS if kind in form.kinds)


def has_any(table: PoseTable, columns: Sequence[str]) -> bool:
    """Whether a table has one of the columns."""
    return any(column in table for column in columns)


@dataclass(frozen=True, eq=False)
class Readings:
    """What the rows of a sheet read; NaN where nothing was.

    Attributes:
        value: Positions, or their changes, (m, 3) [m]; of a distance or a single rotation the
            first [m, rad].
        unloaded: The readings (m, 3) without the load, where the sheet has them.
        differs: Which rows (m,) are changes, or differences of two readings.
    """

    value: Array
    unloaded: Array
    differs: Mask

    @classmethod
    def of(
        cls,
        table: PoseTable,
        kinds: Sequence[Read],
        index: Indices,
        reach: float,
        reference: Reference,
        blank: bool = False,
        needed: bool = True,
    ) -> "Readings":
        """Read the rows of a sheet, each by what its instrument reads.

        Args:
            table: The sheet.
            kinds: What each instrument reads (k,).
            index: Each row's instrument (m,); -1 for one that is passed over.
            reach: Reach of the robot [m].
            reference: What readings are counted from.
            blank: Whether rows may be empty.
            needed: Whether columns have to be there.

        Raises:
            PoseFileError: A row has two readings, one of another kind, half of one, or none.
        """
        of_row = np.array(["", *kinds])[index + 1]
        found = cls.nothing(len(table))
        for form in FORMS:
            own: Mask = np.isin(of_row, form.kinds)
            if not own.any():
                _require_none(table, form, index >= 0)
            elif needed or has_any(table, form.columns):
                part = _read(table, form, own, index < 0, reach, reference, blank)
                found = found.filled(own, part)
        return found

    @classmethod
    def of_one(cls, table: PoseTable, form: Form, reach: float, reference: Reference) -> "Readings":
        """Read one instrument in a sheet with a pose a row."""
        every = np.ones(len(table), dtype=bool)
        return _read(table, form, every, ~every, reach, reference, blank=True)

    @classmethod
    def nothing(cls, rows: int) -> "Readings":
        """Of so many rows, none of which is filled in."""
        value, unloaded = np.full((2, rows, 3), np.nan)
        return cls(value, unloaded, np.zeros(rows, dtype=bool))

    def __getitem__(self, rows: Indices | Mask) -> "Readings":
        """Those of some rows."""
        return Readings(self.value[rows], self.unloaded[rows], self.differs[rows])

    def filled(self, own: Mask, other: "Readings") -> "Readings":
        """With those of another in some rows."""
        return Readings(
            np.where(own[:, None], other.value, self.value),
            np.where(own[:, None], other.unloaded, self.unloaded),
            np.where(own, other.differs, self.differs),
        )


def _require_none(table: PoseTable, form: Form, rows: Mask) -> None:
    """Check that no row has a reading of a kind that none is of.

    Raises:
        PoseFileError: One has; names its column.
    """
    for column in (one for one in form.columns if one in table):
        if (table.filled((column,)) & rows).any():
            raise table.error(f"column {column!r}: no row is of {form.what}")


def _read(
    table: PoseTable,
    form: Form,
    own: Mask,
    passed: Mask,
    reach: float,
    reference: Reference,
    blank: bool,
) -> Readings:
    """Read the rows of one form; see `Readings.of`."""
    wholes = form.whole(table, reference)
    whole = wholes[0]
    groups = (*wholes, form.unloaded, form.change)
    if reference == "nominal" and has_any(table, form.unloaded):
        raise table.error(
            f"column {form.unloaded[0]!r}: the study counts from the nominal robot "
            f"(measurement.reference); expected {', '.join(whole)} alone"
        )
    if not has_any(table, form.columns):
        raise form.missing(table, reference)
    rows = own | passed
    *are_whole, is_unloaded, is_change = (
        rows & (table.filled(group) if has_any(table, group) else np.zeros_like(rows))
        for group in groups
    )
    _require_one_reading(table, groups, (*are_whole, is_unloaded, is_change))
    if not blank:  # such a row is refused for its first empty cell
        empty = own & ~np.any(are_whole, axis=0) & ~is_change
        more = is_change if has_any(table, form.change) else are_whole[0]
        more |= empty
    is_whole = np.any(are_whole, axis=0)
    paired = is_whole & (is_unloaded | (reference == "unloaded"))
    read = np.full((len(table), 3), np.nan)
    for group, chosen in zip(wholes, are_whole, strict=True):
        read = np.where(chosen[:, None], _numbers(table, group, chosen), read)
    before = _numbers(table, form.unloaded, is_unloaded | paired)
    change = _numbers(table, form.change, is_change)
    moved = np.where(paired[:, None], read - before, np.nan) / form.per
    row = first_far(moved, read / form.per, reach)
    if row is not None:
        size = 1e3 * np.sqrt(np.nansum(moved[row] ** 2))
        loaded = wholes[int(np.argmax([chosen[row] for chosen in are_whole]))]
        raise table.error(
            f"the marker moved by {size:.4g} mm under load; are "
            "columns swapped? expected positions without and with load, in the same frame",
            f"row {row + 1}, columns {', '.join((*form.unloaded, *loaded))}",
        )
    alone = np.where(is_change[:, None], change, read) / form.per
    value = np.where(paired[:, None], moved, alone)
    return Readings(value, before / form.per, is_change | paired)


def _require_one_reading(
    table: PoseTable, groups: Sequence[tuple[str, ...]], filled: Sequence[Mask]
) -> None:
    """Check that no row has two readings in itself.

    Args:
        table: The sheet.
        groups: The columns of whole readings, of unloaded ones and of changes, the last.
        filled: The rows (m,) that have each.

    Raises:
        PoseFileError: A row has a reading and a change, or two whole readings; names the columns.
    """
    of_change = [(one, len(groups) - 1) for one in range(len(groups) - 1)]
    for one, other in (*of_change, *((0, 1) for _ in groups[3:])):
        both = np.flatnonzero(filled[one] & filled[other])
        if len(both):
            what = "a reading and a change" if groups[other] == groups[-1] else "two readings"
            raise table.error(
                f"{what}, columns {groups[other][0]!r} and {groups[one][0]!r}; "
                "expected one of them, not both",
                f"row {both[0] + 1}",
            )


def _numbers(table: PoseTable, columns: tuple[str, ...], rows: Mask) -> Array:
    """Numbers (m, 3) of some rows, NaN beyond the columns; the cells of others are empty.

    Raises:
        PoseFileError: A column is missing, or a cell is no number, or not empty.
    """
    found = np.full((len(table), 3), np.nan)
    if rows.any() or has_any(table, columns):
        found[rows, : len(columns)] = table.of_rows(rows).vectors(columns)[rows]
    return found


def read_turns(table: PoseTable, rows: Indices, columns: tuple[str, ...]) -> Array:
    """Rotation vectors (k, 3) [rad] in some rows (k,) of a sheet.

    Args:
        table: The sheet.
        rows: Rows, which have a position.
        columns: Those of a rotation vector [deg], or of a quaternion, scalar first.

    Raises:
        PoseFileError: A column is missing, a cell is no number or empty, or a quaternion is none.
    """
    missing = [column for column in columns if column not in table]
    if missing:
        raise table.error(
            f"column {missing[0]!r} is missing; expected {', '.join(columns)}, as "
            "measurement.rows is 'pose'"
        )
    if {*columns} <= {*VECTOR, *QUATERNION, *ROTATION_COLUMNS}:
        filled = table.filled(columns)  # other markers have theirs in the same columns
    else:
        filled = np.isin(np.arange(len(table)), rows)
    blank = rows[~filled[rows]]
    if len(blank):
        raise table.error("a position without an orientation", f"row {blank[0] + 1}")
    values = table.of_rows(filled).vectors(columns)[rows]
    if len(columns) == len(VECTOR):
        return np.asarray(np.deg2rad(values))
    length = np.linalg.norm(values, axis=1)
    wrong = np.flatnonzero(np.abs(length - 1) > UNIT)
    if len(wrong):
        raise table.error(
            f"a quaternion of length {length[wrong[0]]:.4g}; expected one of length 1",
            f"row {rows[wrong[0]] + 1}",
        )
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(np.roll(values, -1, axis=1)).as_rotvec())


def sheet_instruments(
    table: PoseTable, names: Sequence[str], or_else: str = "", others: Sequence[str] | None = None
) -> tuple[Indices, list[str]]:
    """Index (m,) of each row's instrument, by the name in its column `marker`.

    A sheet of a single instrument may leave the column out.

    Args:
        table: The sheet.
        names: The instruments of the study.
        or_else: What the sheet could have in place of the column.
        others: Names that are passed over in silence; None where nothing is passed over.

    Returns:
        The indices, -1 for rows that are passed over; and the names that the study lacks.

    Raises:
        PoseFileError: The column is missing, or names an instrument that there is not; where some
            are passed over, no row is of one that there is.
    """
    if MARKER_NAME_COLUMN not in table:
        if len(names) == 1:
            return np.zeros(len(table), dtype=int), []
        raise table.error(
            f"column {MARKER_NAME_COLUMN!r} is missing; expected which of {', '.join(names)} each "
            f"row is of{or_else}"
        )
    given = table.texts(MARKER_NAME_COLUMN)
    strange = list(dict.fromkeys(name for name in given if name not in names))
    if strange and (others is None or len(strange) == len(set(given))):
        raise table.error(
            f"no marker {strange[0]!r} in the study; expected one of {', '.join(names)}",
            f"row {given.index(strange[0]) + 1}, column {MARKER_NAME_COLUMN}",
        )
    place = {name: i for i, name in enumerate(names)}
    index = np.array([place.get(name, -1) for name in given], dtype=int)
    return index, [name for name in strange if name not in (others or ())]


def require_loads(table: PoseTable, wrench: Array, rows: Mask) -> None:
    """Check that displacements in some rows (m,) of a sheet are under a load.

    Raises:
        PoseFileError: One is under none.
    """
    unloaded = np.flatnonzero(rows & ~wrench.any(axis=1))
    if len(unloaded):
        raise table.error(
            "a displacement without a load, as the wrench is zero; expected the load that made it",
            f"row {unloaded[0] + 1}, columns Fx_N to Tz_Nm",
        )


def read_by(sensors: Sequence[Sensor]) -> tuple[Read, ...]:
    """What each of some sensors reads (k,)."""
    return tuple(BY_ROWS[sensor.rows] if sensor.lengths.any() else "rotation" for sensor in sensors)


def sheet_markers(
    table: PoseTable, sensors: Sequence[Sensor] = (), index: Indices | None = None
) -> Array:
    """Offsets (m, 3) of what is measured [m]: the sheet's, else the study's, else zero.

    Args:
        table: The sheet.
        sensors: The instruments of the study; there may be none.
        index: Index (m,) of each row's instrument; None without any.
    """
    if any(column in table for column in MARKER_COLUMNS):
        return table.vectors(MARKER_COLUMNS) / 1e3
    if index is None:
        return np.zeros((len(table), 3))
    return np.array([sensor.point.offset for sensor in sensors])[index]


def sheet_turns(sensors: Sequence[Sensor], index: Indices | None) -> Mask | None:
    """Whether each row (m,) of a sheet is a single rotation; None where none is.

    Args:
        sensors: The instruments of the study; there may be none.
        index: Index (m,) of each row's instrument; None without any.
    """
    if index is None:
        return None
    turn = np.array([not sensor.lengths.any() for sensor in sensors])[index]
    return turn if turn.any() else None


def stated_sigma(sigma: Array, sensors: Sequence[Sensor], index: Indices | None) -> Array:
    """The study's noise of each row of a sheet: (rows,), or (m, rows) of several instruments.

    Args:
        sigma: The study's noise, one instrument after another [m, rad].
        sensors: The instruments of the study, which measure as many rows each; there may be none.
        index: Index (m,) of each row's instrument; None without any.
    """
    return sigma if index is None else np.array(np.split(sigma, len(sensors)))[index]


def require_positions_alone(table: PoseTable) -> None:
    """Check that a sheet of positions has no orientations.

    Raises:
        PoseFileError: It has.
    """
    given = [column for column in ROTATION_COLUMNS if column in table]
    if given:
        raise table.error(
            f"column {given[0]!r}: the study measures positions only (measurement.rows)"
        )


def first_far(moved: Array, read: Array, reach: float) -> int | None:
    """The first row (m, c) that was moved by more than any load does; None without one.

    Then columns were swapped, or frames mixed. Displacements that were measured as such are left to
    the findings, which know units; so are positions in other units.

    Args:
        moved: Differences of positions [m]; NaN where there is none.
        read: One of the two positions.
        reach: Reach of the robot [m].
    """
    far = np.flatnonzero(np.nan_to_num(np.abs(moved)).max(axis=1) > FAR * reach)
    if not len(far) or 1e3 * np.nanmax(np.abs(read)) >= MICROMETRES * reach:
        return None
    return int(far[0])


VARIANCES = tuple(COVARIANCE_COLUMNS[i] for i in (0, 3, 5))

NOISE_COLUMNS = ((SIGMA_COLUMN,), AXIS_SIGMA_COLUMNS, COVARIANCE_COLUMNS)


def sheet_noise(
    table: PoseTable, sigma: Array, turn: Mask | None = None
) -> tuple[Array, CorrelatedNoise | None]:
    """Read the noise of displacements: one of all axes, one of each, or a covariance.

    Args:
        table: The sheet.
        sigma: Noise (rows,) of each measured row of the study, or that of each row of the sheet
            (m, rows) [m, rad], which the sheet overrides for positions.
        turn: Whether each row (m,) is a single rotation; None where none is.

    Returns:
        Standard deviations (m, rows) [m, rad]; and the noise where its errors are correlated, else
        None.

    Raises:
        PoseFileError: Names the row and column of a noise that is none, or of two kinds of them.
    """
    # Row by row: a copy in the broadcast's order would change the order of sums, and last digits.
    noise = np.array(np.broadcast_to(sigma, (len(table), np.shape(sigma)[-1])), order="C")
    given = [[column for column in kind if column in table] for kind in NOISE_COLUMNS]
    kinds = [columns for columns in given if columns]
    if len(kinds) > 1:
        raise table.error(
            f"columns {kinds[0][0]!r} and {kinds[1][0]!r}: expected one noise of all axes, or "
            f"{', '.join(AXIS_SIGMA_COLUMNS)}, or {', '.join(COVARIANCE_COLUMNS)}, not both"
        )
    of_all, of_axes, covariance = given
    if noise.shape[1] == 1 and (of_axes or covariance):
        raise table.error(
            f"column {(of_axes or covariance)[0]!r}: a distance has one noise; "
            f"expected {SIGMA_COLUMN}"
        )
    if covariance:
        return _covariance(table, noise)
    if of_all:
        lengths = table if turn is None else table.of_rows(~turn)
        _require_noise(lengths, SIGMA_COLUMN, LEAST_SIGMA_MM)
        stated = lengths.numbers(SIGMA_COLUMN)[:, None] / 1e3
        noise[:, :3] = stated if turn is None else np.where(turn[:, None], noise[:, :3], stated)
    elif of_axes:
        noise[:, :3] = table.vectors(AXIS_SIGMA_COLUMNS) / 1e3
        for column in AXIS_SIGMA_COLUMNS:
            _require_noise(table, column, LEAST_SIGMA_MM)
    return noise, None


def _covariance(table: PoseTable, noise: Array) -> tuple[Array, CorrelatedNoise]:
    """Covariances of displacements, beside the stated noise of rotations."""
    triangle = table.vectors(COVARIANCE_COLUMNS) / 1e6
    for column in VARIANCES:
        _require_noise(table, column, LEAST_SIGMA_MM**2)
    rows = noise.shape[1]
    covariance = noise[:, :, None] * np.eye(rows) * noise[:, None]
    covariance[:, ROWS, COLUMNS] = triangle
    covariance[:, COLUMNS, ROWS] = triangle
    try:
        found = CorrelatedNoise.by_row(covariance)
    except NotPositiveDefiniteError as error:
        raise table.error(
            "the covariance is not positive definite (least eigenvalue of the correlations "
            f"{error.eigenvalue:.2g}); expected errors that vary in every direction",
            f"row {error.row + 1}, columns {COVARIANCE_COLUMNS[0]} to {COVARIANCE_COLUMNS[-1]}",
        ) from error
    return found.std, found


def _require_noise(table: PoseTable, column: str, least: float) -> None:
    """Refuse standard deviations or variances that are not positive."""
    values = table.numbers(column)
    bad = np.flatnonzero((values < least) & (True if table.only is None else table.only))
    if len(bad):
        raise table.error(
            f"row {bad[0] + 1}, column {column}: {values[bad[0]]:g} is not a positive "
            f"number of at least {least:g}"
        )
