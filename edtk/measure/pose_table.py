"""A CSV file with a pose a row: what files of plans and of measurements have in common."""

import difflib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Union

import numpy as np

from edtk.measure.cells import PoseFileError, read_cells
from edtk.robots.joint import UNITS, Joint
from edtk.robots.robot import Robot
from edtk.system.errors import UserError, note
from edtk.system.files import read_text
from edtk.system.typing import Array, Indices, Mask

if TYPE_CHECKING:
    import pandas as pd

# Displacement of the marker under load, or its position without and with load, in the world frame.
DEFLECTION_COLUMNS = ("dx_mm", "dy_mm", "dz_mm")
UNLOADED_COLUMNS = ("x0_mm", "y0_mm", "z0_mm")
LOADED_COLUMNS = ("x_mm", "y_mm", "z_mm")
# Rotation of the tool under load, a small rotation vector in the world frame.
ROTATION_COLUMNS = ("drx_deg", "dry_deg", "drz_deg")
# The same of a distance, or of a single coordinate: its change, or both readings.
CHANGE_COLUMN = "change_mm"
BEFORE_COLUMN = "before_mm"
AFTER_COLUMN = "after_mm"
# The distance itself, in studies of geometry.
DISTANCE_COLUMN = "distance_mm"
# The change of a single rotation.
TURN_COLUMN = "rotation_change_deg"
# Standard deviation of each coordinate of a displacement.
SIGMA_COLUMN = "sigma_mm"
# The same where it is not that of every axis: a laser tracker measures distances best.
AXIS_SIGMA_COLUMNS = ("sigma_x_mm", "sigma_y_mm", "sigma_z_mm")
# Covariance of a displacement in the world frame, as trackers write it: the upper triangle.
COVARIANCE_COLUMNS = (
    "cov_xx_mm2",
    "cov_xy_mm2",
    "cov_xz_mm2",
    "cov_yy_mm2",
    "cov_yz_mm2",
    "cov_zz_mm2",
)
# Offset of the marker from the tool point, in the tool frame.
MARKER_COLUMNS = ("marker_x_mm", "marker_y_mm", "marker_z_mm")
# Number of the visit of a pose: readings within a visit share the errors of the joints.
VISIT_COLUMN = "visit"
# Name of the marker, or of the distance, that a row is of.
MARKER_NAME_COLUMN = "marker"
# A row of which all of these are empty is yet to be measured.
FINISHED_BY = (
    *DEFLECTION_COLUMNS,
    *LOADED_COLUMNS,
    *ROTATION_COLUMNS,
    CHANGE_COLUMN,
    AFTER_COLUMN,
    TURN_COLUMN,
)
# Columns of a measurement sheet that are there together or not at all.
MEASURED_TOGETHER = (
    DEFLECTION_COLUMNS,
    (*UNLOADED_COLUMNS, *LOADED_COLUMNS),
    ROTATION_COLUMNS,
    (SIGMA_COLUMN,),
    AXIS_SIGMA_COLUMNS,
    COVARIANCE_COLUMNS,
    MARKER_COLUMNS,
    (VISIT_COLUMN,),
    (MARKER_NAME_COLUMN,),
    (CHANGE_COLUMN,),
    (BEFORE_COLUMN, AFTER_COLUMN),
    (TURN_COLUMN,),
)
# Errors of a compensated task without compensation, and with it: root mean square and band.
# They begin with the row of the task where some of its rows are left out.
ROW_COLUMN = "row"
UNCOMPENSATED_COLUMN = "uncompensated_mm"
REMAINING_COLUMN = "remaining_rms_mm"
BAND_COLUMNS = ("remaining_low_mm", "remaining_high_mm")
# Parts of what remains: by the noise, and by joints that are not identified.
PART_COLUMNS = ("remaining_by_noise_mm", "remaining_by_assumed_joints_mm")
UNCOMPENSATED_ROTATION_COLUMN = "uncompensated_rotation_deg"
REMAINING_ROTATION_COLUMN = "remaining_rotation_rms_deg"
NAMES = ("x", "y", "z", "rotation x", "rotation y", "rotation z")
MARK = "joint:"  # before a header that would otherwise mean something else
FORMULA = ("=", "+", "-", "@")  # a spreadsheet runs a cell that begins with one of these
MOST_MB = 1000.0  # of a file; a million rows have 200 MB
LONGEST_CELL = 300  # of a cell of a column that is not all numbers
LARGEST = 1e12  # number in a file; no quantity here comes near it in its unit
MISSPELT = 0.8  # of the letters of a header, from which another is taken for a slip of the pen
WRENCH_COLUMNS = ("Fx_N", "Fy_N", "Fz_N", "Tx_Nm", "Ty_Nm", "Tz_Nm")
# Where the load acts: offset from the tool point, in the tool frame. Behind a wrench in its array.
LOAD_COLUMNS = ("load_x_mm", "load_y_mm", "load_z_mm")
DIGITS = 3  # decimals of a degree or a millimetre that a controller takes
DECIMALS = 9  # of a millimetre that a conversion to metres and back keeps
CONVERSION = 1e-10  # [deg or mm]: more than the rounding of a conversion to SI units and back


SHEET_COLUMNS = tuple(column for group in MEASURED_TOGETHER for column in group)

# Headers that no joint may have.
RESERVED = (
    *SHEET_COLUMNS,
    DISTANCE_COLUMN,
    ROW_COLUMN,
    UNCOMPENSATED_COLUMN,
    REMAINING_COLUMN,
    *BAND_COLUMNS,
    *PART_COLUMNS,
    UNCOMPENSATED_ROTATION_COLUMN,
    REMAINING_ROTATION_COLUMN,
    *LOAD_COLUMNS,
)


def wrench_columns(wrench: Array) -> tuple[str, ...]:
    """Headers of wrenches (k, 6), or (k, 9) where loads act at several places."""
    return (*WRENCH_COLUMNS, *LOAD_COLUMNS)[: wrench.shape[1]]


def wrench_in_file_units(wrench: Array) -> Array:
    """Wrenches (k, 6 or 9) as files have them [N, N m, mm]."""
    return np.concatenate([wrench[:, :6], np.round(1e3 * wrench[:, 6:], DECIMALS)], axis=1)


def coordinate_columns(rows: int) -> tuple[str, ...]:
    """Headers of the coordinates of positions (3 rows), poses (6) or distances (1)."""
    if rows == 1:
        return (CHANGE_COLUMN,)
    return (*DEFLECTION_COLUMNS, *ROTATION_COLUMNS)[:rows]


def coordinate_names(rows: int) -> tuple[str, ...]:
    """The same in words."""
    return ("change",) if rows == 1 else NAMES[:rows]


def pose_columns(robot: Robot) -> tuple[str, ...]:
    """Column headers of the joint variables: NAME_deg, or NAME_mm for a prismatic joint.

    Where that is the header of another column, such as `x_mm`, or where a spreadsheet would take it
    for a formula, it is `joint:NAME_mm`. No two joints share a header.
    """
    return tuple(_header(joint) for joint in robot.joints)


def with_own_headers(
    header: Sequence[str], robot: Robot, others: Sequence[str] = ()
) -> tuple[str, ...]:
    """A file's header, in which each joint has the header of `pose_columns`.

    A file may have NAME_mm where the joint's own header is `joint:NAME_mm`. It is the joint's,
    unless the file has all the columns that are measured together with that one.

    Args:
        header: The headers of the file.
        robot: Names the joints.
        others: Headers that the file may have besides those of joints.
    """
    own = pose_columns(robot)
    renamed = {}
    for joint, column in zip(robot.joints, own, strict=True):
        plain = _plain(joint)
        if column not in header and plain not in own and not _measured(plain, header, others):
            renamed[plain] = column
    return tuple(renamed.get(column, column) for column in header)


def _measured(column: str, header: Sequence[str], others: Sequence[str]) -> bool:
    """Whether a header can be that of a measurement: all that belongs to it is there."""
    groups = (group for group in MEASURED_TOGETHER if column in group and column in others)
    return any(set(group) <= set(header) for group in groups)


def _header(joint: Joint) -> str:
    """The header of one joint."""
    plain = _plain(joint)
    # A name that itself begins with the mark gets a second one, so that headers stay different.
    marked = plain in RESERVED or plain.startswith((MARK, *FORMULA))
    return MARK + plain if marked else plain


def _plain(joint: Joint) -> str:
    """Name and unit of one joint."""
    return f"{joint.name}_{UNITS[joint.kind]}"


Table = Union[Path, str, "pd.DataFrame"]  # a CSV file, or what one holds
IN_MEMORY = Path("data frame")  # names in messages what is no file


def path_of(given: Table) -> Path:
    """The path of a table's file, by which messages name it; a word for a data frame."""
    return Path(given) if isinstance(given, str | Path) else IN_MEMORY


def pose_factors(robot: Robot) -> Array:
    """Factors (n,) from a file's units to SI: pi/180 for degrees, 1e-3 for millimetres."""
    return robot.units


@dataclass(frozen=True, eq=False)
class PoseTable:
    """The cells of a file; rows are counted from 1, the header left out.

    Args:
        path: Where the file is, for messages.
        cells: Its columns by name: finite numbers, or a data frame whose columns may hold anything.
        only: The rows (k,) whose cells are looked at, by `of_rows`; None for all.
    """

    path: Path
    cells: Union["pd.DataFrame", dict[str, Array]]
    only: Mask | None = None

    @classmethod
    def read(cls, given: Table, content: str) -> "PoseTable":
        """Read a file, or take a data frame that holds what a file would.

        Args:
            given: The CSV file, where the rest of a line after a # is a comment; or the table.
            content: The name of its content in messages: "plan".

        Raises:
            PoseFileError: The file is empty or ragged.
            UserError: The file is absent, or is no text; or this is no table.
        """
        path = path_of(given)
        if isinstance(given, str | Path):
            table = cls(path, read_cells(read_text(path, MOST_MB, utf_16=True), path))
        else:
            table = cls(path, _frame(given))
        if not len(table):
            raise table.error(f"the {content} has no rows")
        return table

    def __contains__(self, column: str) -> bool:
        return column in self.cells

    def __len__(self) -> int:
        if isinstance(self.cells, dict):
            return len(next(iter(self.cells.values())))
        return len(self.cells)

    def error(self, message: str, key: str | None = None) -> PoseFileError:
        """An error in this file, to be raised.

        Args:
            message: What is wrong or was expected.
            key: The row or column.
        """
        return PoseFileError(message, where=self.path, key=key)

    def with_known(self, robot: Robot, optional: tuple[str, ...]) -> "PoseTable":
        """The same table, of which each column is a joint's, a wrench's, or one of `optional`.

        Joints have the headers of `pose_columns`, whichever form the file has.

        Raises:
            PoseFileError: Names the first that is not.
        """
        header = [str(column) for column in self.cells]
        columns = pose_columns(robot)
        known = (*columns, *WRENCH_COLUMNS, *LOAD_COLUMNS, *optional)
        header = list(with_own_headers(header, robot, optional))
        twice = [column for i, column in enumerate(header) if column in header[:i]]
        if twice:
            raise self.error(f"column {twice[0]!r} is there twice; expected each once")
        unknown = [column for column in header if column not in known]
        if unknown:
            raise self.error(
                f"unknown column {unknown[0]!r}{_meant(unknown[0], known, header)}; expected "
                f"{', '.join(columns)}, "
                f"and optionally {', '.join((*optional, *WRENCH_COLUMNS))}"
            )
        if isinstance(self.cells, dict):
            return replace(self, cells=dict(zip(header, self.cells.values(), strict=True)))
        return replace(self, cells=self.cells.set_axis(header, axis="columns"))

    def of_rows(self, rows: Mask | None) -> "PoseTable":
        """The same table where numbers stand in some rows (k,) alone, and count as zero in others.

        Args:
            rows: The rows whose cells have numbers; those of the others must be empty. None for
                all.
        """
        return replace(self, only=rows)

    def of_some(self, rows: Mask | Indices) -> "PoseTable":
        """The rows (k,) of the table that are chosen, or those of some numbers in their order."""
        if isinstance(self.cells, dict):
            return replace(self, cells={name: cells[rows] for name, cells in self.cells.items()})
        chosen = np.arange(len(self))[rows]
        return replace(self, cells=self.cells.iloc[chosen].reset_index(drop=True))

    def without(self, columns: Sequence[str]) -> "PoseTable":
        """The same table without some columns, as far as it has them."""
        if isinstance(self.cells, dict):
            kept = {name: cells for name, cells in self.cells.items() if name not in columns}
            return replace(self, cells=kept)
        return replace(self, cells=self.cells.drop(columns=list(columns), errors="ignore"))

    def filled(self, columns: tuple[str, ...]) -> Mask:
        """Which rows (k,) have a cell that is not empty in one of the columns."""
        there = [column for column in columns if column in self]
        if isinstance(self.cells, dict) or not there:
            return np.ones(len(self), dtype=bool)
        return np.asarray(self.cells[there].notna().any(axis=1).to_numpy())

    def numbers(self, column: str) -> Array:
        """One column as finite numbers.

        Raises:
            PoseFileError: Names the first row whose cell is not a finite number.
        """
        values = self.cells[column] if isinstance(self.cells, dict) else self._finite(column)
        large = np.flatnonzero(np.abs(values) > LARGEST)
        if len(large):
            row = large[0]
            raise self.error(
                f"{values[row]:g} is larger than {LARGEST:g}", f"row {row + 1}, column {column}"
            )
        return values

    def vectors(self, columns: tuple[str, ...]) -> Array:
        """Columns (k, columns) that belong together, as finite numbers.

        Raises:
            PoseFileError: A column is missing, or a cell is not a number.
        """
        missing = [column for column in columns if column not in self]
        if missing:
            raise self.error(f"column {missing[0]!r} is missing; expected {', '.join(columns)}")
        return np.stack([self.numbers(column) for column in columns], axis=-1)

    def texts(self, column: str) -> list[str]:
        """One column as texts, without blanks at their ends."""
        if isinstance(self.cells, dict):
            return [f"{number:g}" for number in self.cells[column]]
        return [str(cell).strip() for cell in self.cells[column]]

    def _finite(self, column: str) -> Array:
        """The numbers of a data frame's column, each checked."""
        import pandas as pd

        assert not isinstance(self.cells, dict)
        cells = self.cells[column]
        if self.only is not None:
            filled = np.flatnonzero(~self.only & cells.notna().to_numpy())
            if len(filled):
                where = f"row {filled[0] + 1}, column {column}"
                raise self.error("expected an empty cell in a row of this kind", where)
            cells = cells.where(self.only, 0.0)
        digits = cells
        if cells.dtype == object:
            # Pandas ends in an OverflowError for whole numbers beyond the largest float.
            digits = cells.mask(cells.astype(str).str.len() > LONGEST_CELL)
        values = pd.to_numeric(digits, errors="coerce").to_numpy(dtype=float)
        # Pandas reads a column of nothing but "True" and "False" as 1 and 0.
        bad = np.flatnonzero(~np.isfinite(values) | (cells.dtype == bool))
        if len(bad):
            row = bad[0]
            cell = cells.iloc[row]
            shown = "an empty or NaN cell" if pd.isna(cell) else repr(str(cell))
            raise self.error(f"{shown} is not a finite number", f"row {row + 1}, column {column}")
        return values

    def poses(self, robot: Robot, fixed: dict[int, float]) -> Array:
        """Joint variables (k, n) of the model [rad or m], from the controller's in the file.

        Args:
            robot: Names the columns.
            fixed: Values [rad or m] of joints, by index, that the file may leave out.

        Raises:
            PoseFileError: A joint's column is missing, or a cell is not a number.
        """
        columns = pose_columns(robot)
        missing = [c for j, c in enumerate(columns) if c not in self and j not in fixed]
        if missing:
            plain = missing[0].removeprefix(MARK)
            taken = f"; {plain!r} is a measurement here" if plain in self else ""
            raise self.error(
                f"column {missing[0]!r} is missing and the study does not fix that joint{taken}"
            )
        default = robot.shown(np.array([fixed.get(j, 0.0) for j in range(robot.n)]))
        shown = default * np.ones((len(self), 1))
        for j, (column, factor) in enumerate(zip(columns, pose_factors(robot), strict=True)):
            if column in self:
                shown[:, j] = self.numbers(column) * factor
        return robot.of_shown(shown)

    def wrenches(self, default: Array | None) -> Array:
        """Forces and torques (k, 6) [N, N m]; (k, 9) where the file says where each load acts.

        Args:
            default: Wrench (6,) of which a column of the file overrides a component. None where the
                file must say which forces are applied; torques then default to zero.
                With three numbers more the loads act at several places, and the file must say where
                each does.

        Raises:
            PoseFileError: A force's column is missing, or a cell is not a number.
        """
        if default is None:
            missing = [column for column in WRENCH_COLUMNS[:3] if column not in self]
            if missing:
                raise self.error(
                    f"column {missing[0]!r} is missing, and the study leaves the load open"
                )
            default = np.zeros(6)
        W = np.tile(np.asarray(default, dtype=float), (len(self), 1))
        for j, column in enumerate(WRENCH_COLUMNS):
            if column in self:
                W[:, j] = self.numbers(column)
        if any(column in self for column in LOAD_COLUMNS):
            return np.concatenate([W[:, :6], self.vectors(LOAD_COLUMNS) / 1e3], axis=1)
        if W.shape[1] > len(WRENCH_COLUMNS) and W.any():
            raise self.error(
                f"column {LOAD_COLUMNS[0]!r} is missing, and the study has loads at several places"
            )
        return W


def _frame(given: object) -> "pd.DataFrame":
    """A data frame whose rows are counted from 0, and whose columns have names.

    Raises:
        UserError: It is none.
    """
    import pandas as pd

    if not isinstance(given, pd.DataFrame):
        kind = type(given).__name__
        raise UserError(f"expected the path of a CSV file, or a data frame, not {kind}")
    return given.set_axis([str(name).strip() for name in given], axis="columns").reset_index(
        drop=True
    )


def _meant(unknown: str, known: Sequence[str], header: Sequence[str]) -> str:
    """The column that was meant by an unknown one, in words; empty where none is like it."""
    missing = [column for column in known if column not in header]
    near = difflib.get_close_matches(unknown, missing, 1, MISSPELT)
    return f", perhaps {near[0]!r}" if near else ""


def in_file_units(robot: Robot, q: Array) -> Array:
    """What the controller shows (..., n) in degrees and millimetres, for q (..., n) [rad or m].

    A number that a controller takes comes out as that number to the last digit.
    """
    values = np.asarray(robot.shown(q) / pose_factors(robot))
    whole = np.round(values, DIGITS)
    # The sum has no negative zero.
    return np.where(np.abs(values - whole) <= CONVERSION, whole, values) + 0.0


def of_file_units(robot: Robot, values: Array) -> Array:
    """Joint variables (..., n) [rad or m] for what the controller shows (..., n) [deg or mm]."""
    return robot.of_shown(np.asarray(values * pose_factors(robot)))


def controller_step(robot: Robot) -> Array:
    """Steps (n,) in which a controller takes joint variables [rad or m]."""
    return np.asarray(pose_factors(robot) / 10**DIGITS)


def rounded(robot: Robot, q: Array) -> Array:
    """Joint variables (..., n) [rad or m] as a controller takes them, nearest to q (..., n).

    A file gives the same numbers back, bit by bit.
    """
    shown = np.round(robot.shown(q) / pose_factors(robot), DIGITS) + 0.0
    return of_file_units(robot, shown)


def finished_rows(table: PoseTable) -> PoseTable:
    """Leave out the rows of a sheet that are not filled in yet, with a note that says how many.

    Raises:
        PoseFileError: No row is filled in.
    """
    done = table.filled(FINISHED_BY)
    if done.all():
        return table
    columns = [column for column in FINISHED_BY if column in table]
    if not done.any():
        raise table.error(f"no row is filled in; expected measurements in {', '.join(columns)}")
    count = int(done.sum())
    gaps = not done[: np.flatnonzero(done)[-1]].all()
    counted = "; rows are counted without them" if gaps else ""
    note(f"{count} of {len(table)} rows are filled in, the others left out{counted}", table.path)
    return table.of_some(done)
