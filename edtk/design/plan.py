"""A plan of experiments: poses, wrenches and repetitions, as arrays and as a CSV file."""

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from edtk.atomic import atomic_path
from edtk.model import Robot

Array = NDArray[np.float64]
WRENCH_COLUMNS = ("Fx_N", "Fy_N", "Fz_N", "Tx_Nm", "Ty_Nm", "Tz_Nm")


class PlanFileError(ValueError):
    """A plan file that cannot be read as one; names the file and the row or column."""


def pose_columns(robot: Robot) -> tuple[str, ...]:
    """Column headers of the joint variables: NAME_deg, or NAME_mm for a prismatic joint."""
    return tuple(f"{j.name}_{'mm' if j.kind == 'prismatic' else 'deg'}" for j in robot.joints)


def pose_factors(robot: Robot) -> Array:
    """Factors (n,) from a file's units to SI: pi/180 for degrees, 1e-3 for millimetres."""
    return np.array([1e-3 if j.kind == "prismatic" else np.pi / 180 for j in robot.joints])


@dataclass(frozen=True, eq=False)
class Plan:
    """Poses to measure, each with its wrench and a number of repetitions.

    Args:
        q: Joint variables (k, n) [rad or m].
        wrench: Forces and torques (k, 6) [N, N m].
        repeats: Measurements per pose (k,), at least one each.

    Raises:
        ValueError: Shapes do not fit, an entry is not finite, or a repetition is below one.
    """

    q: Array
    wrench: Array
    repeats: NDArray[np.int_]

    def __post_init__(self) -> None:
        k = len(self.q)
        if self.q.ndim != 2 or self.wrench.shape != (k, 6) or self.repeats.shape != (k,) or not k:
            raise ValueError("a plan needs q (k, n), wrench (k, 6) and repeats (k,), with k > 0")
        if not (np.isfinite(self.q).all() and np.isfinite(self.wrench).all() and (self.repeats >= 1).all()):
            raise ValueError("a plan's entries must be finite and its repetitions at least one")

    @property
    def experiments(self) -> int:
        """Number of measurements m, repetitions counted."""
        return int(self.repeats.sum())

    def repeated(self, times: int) -> "Plan":
        """The same plan carried out several times."""
        return Plan(self.q, self.wrench, self.repeats * times)

    def __add__(self, more: "Plan") -> "Plan":
        """These experiments and others."""
        q, wrench = np.concatenate([self.q, more.q]), np.concatenate([self.wrench, more.wrench])
        return Plan(q, wrench, np.concatenate([self.repeats, more.repeats]))

    def table(self, robot: Robot) -> pd.DataFrame:
        """Poses, repetitions and wrenches as a file has them: degrees, millimetres, newtons and newton metres."""
        table = pd.DataFrame(self.q / pose_factors(robot), columns=list(pose_columns(robot)))
        table["repeats"] = self.repeats
        table[list(WRENCH_COLUMNS)] = self.wrench
        return table

    def to_csv(self, path: Path, robot: Robot) -> None:
        """Write the plan atomically, see `table`."""
        with atomic_path(path) as temporary:
            self.table(robot).to_csv(temporary, index=False, float_format="%.10g")

    @classmethod
    def from_csv(cls, path: Path, robot: Robot, fixed: dict[int, float], wrench: Array | None) -> "Plan":
        """Read a plan: columns q1_deg .. qn_deg, optionally `repeats` and all or some wrench columns.

        Args:
            path: The CSV file; rows are counted from 1, the header left out.
            robot: Names the columns.
            fixed: Values [rad or m] of joints, by index, that the file may leave out.
            wrench: Default wrench (6,); a wrench column of the file overrides its component. None where the file must
                say which forces are applied.

        Raises:
            PlanFileError: Names the file and the row or column.
        """
        table = _read_table(path)
        columns = pose_columns(robot)
        unknown = [c for c in table if c not in (*columns, *WRENCH_COLUMNS, "repeats")]
        if unknown:
            raise PlanFileError(
                f"{path}: unknown column {unknown[0]!r}; expected {', '.join(columns)}, "
                f"and optionally repeats, {', '.join(WRENCH_COLUMNS)}"
            )
        missing = [c for j, c in enumerate(columns) if c not in table and j not in fixed]
        if missing:
            raise PlanFileError(f"{path}: column {missing[0]!r} is missing and the study does not fix that joint")
        q = np.array([fixed.get(j, 0.0) for j in range(robot.n)]) * np.ones((len(table), 1))
        for j, (column, factor) in enumerate(zip(columns, pose_factors(robot), strict=True)):
            if column in table:
                q[:, j] = _numbers(table, column, path) * factor
        if wrench is None and (missing := [c for c in WRENCH_COLUMNS[:3] if c not in table]):
            raise PlanFileError(f"{path}: column {missing[0]!r} is missing, and the study leaves the load open")
        W = np.tile(np.zeros(6) if wrench is None else np.asarray(wrench, dtype=float), (len(table), 1))
        for j, column in enumerate(WRENCH_COLUMNS):
            if column in table:
                W[:, j] = _numbers(table, column, path)
        return cls(q, W, _repeats(table, path))


def _read_table(path: Path) -> pd.DataFrame:
    """The file as text cells; an empty, ragged or absent file is named."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)  # a row longer than the header
            table = pd.read_csv(path, dtype=str, skipinitialspace=True, comment="#", index_col=False)
    except FileNotFoundError:
        raise PlanFileError(f"{path}: no such file") from None
    except (
        OSError,
        UnicodeDecodeError,
        pd.errors.ParserError,
        pd.errors.EmptyDataError,
        pd.errors.ParserWarning,
    ) as error:
        raise PlanFileError(f"{path}: not readable as CSV ({str(error).splitlines()[0].strip()})") from error
    if table.empty:
        raise PlanFileError(f"{path}: the plan has no rows")
    return table


def _numbers(table: pd.DataFrame, column: str, path: Path) -> Array:
    """One column as finite numbers."""
    values = pd.to_numeric(table[column], errors="coerce").to_numpy(dtype=float)
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        cell = table[column].iloc[bad[0]]
        shown = "an empty or NaN cell" if pd.isna(cell) else repr(cell)
        raise PlanFileError(f"{path}: row {bad[0] + 1}, column {column}: {shown} is not a finite number")
    return values


def _repeats(table: pd.DataFrame, path: Path) -> NDArray[np.int_]:
    """Repetitions (k,), one each where the file has no such column."""
    if "repeats" not in table:
        return np.ones(len(table), dtype=int)
    values = _numbers(table, "repeats", path)
    bad = np.flatnonzero((values < 1) | (values > 1e9) | (values != np.round(values)))
    if len(bad):
        raise PlanFileError(
            f"{path}: row {bad[0] + 1}, column repeats: {values[bad[0]]:g} is not a whole number from 1 to 1e9"
        )
    return values.astype(int)
