"""A CSV file with a pose a row: what files of plans and of measurements have in common."""

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from edtk.model.robot import Robot

Array = NDArray[np.float64]
LARGEST = 1e12  # number in a file; no quantity here comes near it in its unit
WRENCH_COLUMNS = ("Fx_N", "Fy_N", "Fz_N", "Tx_Nm", "Ty_Nm", "Tz_Nm")


class PoseFileError(ValueError):
    """A file that cannot be read as a table of poses; names the file and the row or column."""


def pose_columns(robot: Robot) -> tuple[str, ...]:
    """Column headers of the joint variables: NAME_deg, or NAME_mm for a prismatic joint."""
    return tuple(f"{j.name}_{'mm' if j.kind == 'prismatic' else 'deg'}" for j in robot.joints)


def pose_factors(robot: Robot) -> Array:
    """Factors (n,) from a file's units to SI: pi/180 for degrees, 1e-3 for millimetres."""
    return np.array([1e-3 if j.kind == "prismatic" else np.pi / 180 for j in robot.joints])


@dataclass(frozen=True, eq=False)
class PoseTable:
    """The cells of a file; rows are counted from 1, the header left out.

    Args:
        path: Where the file lies, for messages.
        cells: Its columns; one that is not numbers throughout has text.
    """

    path: Path
    cells: pd.DataFrame

    @classmethod
    def read(cls, path: Path | str, what: str) -> "PoseTable":
        """Read a file.

        Args:
            path: The CSV file; what follows a # is a comment.
            what: What a person calls its content: "plan".

        Raises:
            PoseFileError: The file is absent, empty or ragged.
        """
        path = Path(path)
        if sign := _separator(path):
            raise PoseFileError(
                f"{path}: the columns are separated by {sign}; expected commas, and points in numbers"
            )
        try:
            with warnings.catch_warnings():
                warnings.simplefilter(
                    "error", pd.errors.ParserWarning
                )  # a row longer than the header
                cells = pd.read_csv(
                    path, skipinitialspace=True, comment="#", index_col=False, low_memory=False
                )
        except FileNotFoundError:
            raise PoseFileError(f"{path}: no such file") from None
        except (
            OSError,
            UnicodeDecodeError,
            pd.errors.ParserError,
            pd.errors.EmptyDataError,
            pd.errors.ParserWarning,
        ) as error:
            why = (
                "a row has more cells than the header"
                if isinstance(error, pd.errors.ParserWarning)
                else _first_line(error)
            )
            raise PoseFileError(
                f"{path}: not readable as CSV ({why}); expected commas between columns"
            ) from error
        if cells.empty:
            raise PoseFileError(f"{path}: the {what} has no rows")
        return cls(path, cells)

    def __contains__(self, column: str) -> bool:
        return column in self.cells

    def __len__(self) -> int:
        return len(self.cells)

    def error(self, message: str) -> PoseFileError:
        """A mistake in this file."""
        return PoseFileError(f"{self.path}: {message}")

    def require_known(self, robot: Robot, optional: tuple[str, ...]) -> None:
        """Check that each column is a joint's, a wrench's, or one of `optional`.

        Raises:
            PoseFileError: Names the first that is not, or what is wrong with the header.
        """
        columns = pose_columns(robot)
        header = list(map(str, self.cells))
        for column in header:
            if (first := column.rpartition(".")[0]) in header and column.rpartition(".")[
                2
            ].isdigit():
                raise self.error(f"column {first!r} is there twice; expected each once")
            if column.startswith("Unnamed: "):
                number = int(column.rpartition(" ")[2]) + 1
                raise self.error(f"column {number} has no name; expected one in the header")
        unknown = [c for c in self.cells if c not in (*columns, *WRENCH_COLUMNS, *optional)]
        if unknown:
            raise self.error(
                f"unknown column {unknown[0]!r}; expected {', '.join(columns)}, "
                f"and optionally {', '.join((*optional, *WRENCH_COLUMNS))}"
            )

    def numbers(self, column: str) -> Array:
        """One column as finite numbers.

        Raises:
            PoseFileError: Names the first row whose cell is none.
        """
        cells = self.cells[column]
        values = pd.to_numeric(cells, errors="coerce").to_numpy(dtype=float)
        bad = np.flatnonzero(~np.isfinite(values) | (cells.dtype == bool))  # "True" is read as 1
        if len(bad):
            cell = cells.iloc[bad[0]]
            shown = "an empty or NaN cell" if pd.isna(cell) else repr(str(cell))
            raise self.error(f"row {bad[0] + 1}, column {column}: {shown} is not a finite number")
        large = np.flatnonzero(np.abs(values) > LARGEST)
        if len(large):
            raise self.error(
                f"row {large[0] + 1}, column {column}: {values[large[0]]:g} is larger than {LARGEST:g}"
            )
        return values

    def poses(self, robot: Robot, fixed: dict[int, float]) -> Array:
        """Joint variables (k, n) [rad or m].

        Args:
            robot: Names the columns.
            fixed: Values [rad or m] of joints, by index, that the file may leave out.

        Raises:
            PoseFileError: A joint's column is missing, or a cell is not a number.
        """
        columns = pose_columns(robot)
        missing = [c for j, c in enumerate(columns) if c not in self and j not in fixed]
        if missing:
            raise self.error(
                f"column {missing[0]!r} is missing and the study does not fix that joint"
            )
        q = np.array([fixed.get(j, 0.0) for j in range(robot.n)]) * np.ones((len(self), 1))
        for j, (column, factor) in enumerate(zip(columns, pose_factors(robot), strict=True)):
            if column in self:
                q[:, j] = self.numbers(column) * factor
        return q

    def wrenches(self, default: Array | None) -> Array:
        """Forces and torques (k, 6) [N, N m].

        Args:
            default: Wrench (6,) of which a column of the file overrides a component. None where the file must say
                which forces are applied.

        Raises:
            PoseFileError: A force's column is missing, or a cell is not a number.
        """
        if default is None and (missing := [c for c in WRENCH_COLUMNS[:3] if c not in self]):
            raise self.error(
                f"column {missing[0]!r} is missing, and the study leaves the load open"
            )
        W = np.tile(
            np.zeros(6) if default is None else np.asarray(default, dtype=float), (len(self), 1)
        )
        for j, column in enumerate(WRENCH_COLUMNS):
            if column in self:
                W[:, j] = self.numbers(column)
        return W


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0].strip()


def _separator(path: Path) -> str | None:
    """What separates the columns of the header, if not commas."""
    if not path.is_file():  # a pipe can be read but once
        return None
    try:
        with path.open(encoding="utf-8-sig") as file:
            header = next((line for line in file if line.strip() and not line.startswith("#")), "")
    except (OSError, UnicodeDecodeError):
        return None  # it is told when the file is read
    names = {";": "semicolons", "\t": "tabs"}
    return next(
        (name for sign, name in names.items() if sign in header and "," not in header), None
    )
