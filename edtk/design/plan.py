"""A plan of experiments: poses, wrenches and repetitions, as arrays and as a CSV file."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from edtk.model.robot import Robot
from edtk.system.atomic_file import atomic_path
from edtk.tables.pose_table import (
    WRENCH_COLUMNS,
    PoseFileError,
    PoseTable,
    pose_columns,
    pose_factors,
)

Array = NDArray[np.float64]
__all__ = ["WRENCH_COLUMNS", "Plan", "PlanFileError", "pose_columns", "pose_factors"]
PlanFileError = PoseFileError  # what is wrong with a plan's file is wrong with its table


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
        if not (
            np.isfinite(self.q).all()
            and np.isfinite(self.wrench).all()
            and (self.repeats >= 1).all()
        ):
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

    def to_csv(self, path: Path | str, robot: Robot) -> None:
        """Write the plan atomically, see `table`."""
        with atomic_path(path) as temporary:
            self.table(robot).to_csv(temporary, index=False, float_format="%.10g")

    @classmethod
    def from_csv(
        cls, path: Path | str, robot: Robot, fixed: dict[int, float], wrench: Array | None
    ) -> "Plan":
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
        table = PoseTable.read(path, "plan")
        table.require_known(robot, ("repeats",))
        return cls(table.poses(robot, fixed), table.wrenches(wrench), _repeats(table))


def _repeats(table: PoseTable) -> NDArray[np.int_]:
    """Repetitions (k,), one each where the file has no such column."""
    if "repeats" not in table:
        return np.ones(len(table), dtype=int)
    values = table.numbers("repeats")
    bad = np.flatnonzero((values < 1) | (values > 1e9) | (values != np.round(values)))
    if len(bad):
        raise table.error(
            f"row {bad[0] + 1}, column repeats: {values[bad[0]]:g} is not a whole number from 1 to 1e9"
        )
    return values.astype(int)
