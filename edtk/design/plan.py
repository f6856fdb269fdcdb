"""A plan of experiments: poses, wrenches and repetitions, as arrays and as a CSV file."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.measure.cells import csv_text
from edtk.measure.pose_table import (
    PoseTable,
    Table,
    in_file_units,
    pose_columns,
    wrench_columns,
    wrench_in_file_units,
)
from edtk.robots.frames import all_wrenches
from edtk.robots.robot import Robot
from edtk.system.errors import ArgumentError, real_numbers
from edtk.system.files import write_text
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices

if TYPE_CHECKING:
    import pandas as pd

REPEATS = "repeats"  # the column of how often a pose is measured
MOST_REPEATS = 1e9  # of one pose in a file; beyond it a whole number is hardly what was meant


@dataclass(frozen=True, eq=False)
class Plan(Presented):
    """Poses to measure, each with its wrench and a number of repetitions.

    Args:
        q: Joint variables (k, n) [rad or m].
        wrench: Forces and torques (k, 6) [N, N m], or (k, 9) where loads act at several places, see
            `BodyPoint.of_load`.
        repeats: Measurements per pose (k,), whole numbers, at least one each.

    Raises:
        ValueError: Shapes do not fit, an entry is not finite, or a repetition is below one or not
            whole.
    """

    q: Array
    wrench: Array
    repeats: Indices

    def __post_init__(self) -> None:
        for name in ("q", "wrench", "repeats"):
            if not real_numbers(getattr(self, name), name).ndim:
                raise ArgumentError("expected an array", argument=name)
            object.__setattr__(self, name, np.asarray(getattr(self, name)))
        k = len(self.q)
        loads = self.wrench.shape in ((k, 6), (k, 9))
        if self.q.ndim != 2 or not loads or self.repeats.shape != (k,) or not k:
            raise ValueError("a plan needs q (k, n), wrench (k, 6) and repeats (k,), with k > 0")
        finite = np.isfinite(self.q).all() and np.isfinite(self.wrench).all()
        repeats = real_numbers(self.repeats, "repeats")
        if not (finite and (repeats >= 1).all()):
            raise ValueError("a plan's entries must be finite and its repetitions at least one")
        if (repeats != np.round(repeats)).any() or repeats.max() > MOST_REPEATS:
            raise ArgumentError("expected whole numbers from 1 to 1e9", argument="repeats")
        object.__setattr__(self, "repeats", repeats.astype(int))

    def headline(self) -> str:
        """Number of experiments and of poses."""
        return f"{self.experiments} experiments in {len(self.q)} poses of {self.q.shape[1]} joints"

    @property
    def experiments(self) -> int:
        """Number of measurements m, repetitions counted."""
        return int(self.repeats.sum())

    def repeated(self, times: int) -> "Plan":
        """The same plan carried out several times."""
        return Plan(self.q, self.wrench, self.repeats * times)

    def __add__(self, more: "Plan") -> "Plan":
        """The experiments of this plan, then those of another one."""
        return Plan(
            np.concatenate([self.q, more.q]),
            all_wrenches(self.wrench, more.wrench),
            np.concatenate([self.repeats, more.repeats]),
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers in SI units, from which `from_dict` makes the same plan again."""
        return {
            "q": self.q.tolist(),
            "wrench": self.wrench.tolist(),
            "repeats": self.repeats.tolist(),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Plan":
        """Make a plan from the numbers of `to_dict`; other keys are ignored.

        Raises:
            KeyError: A key is missing.
            ValueError: The numbers are not those of a plan.
        """
        return cls(
            np.array(data["q"], dtype=float),
            np.array(data["wrench"], dtype=float),
            np.array(data["repeats"], dtype=int),
        )

    def to_frame(self, robot: Robot) -> "pd.DataFrame":
        """Make a table with a pose a row, as a file has it.

        Joint variables are in degrees or millimetres, wrenches in newtons and newton metres.

        Args:
            robot: The robot, which names the columns.
        """
        import pandas as pd

        frame = pd.DataFrame(in_file_units(robot, self.q), columns=list(pose_columns(robot)))
        frame["repeats"] = self.repeats
        frame[list(wrench_columns(self.wrench))] = wrench_in_file_units(self.wrench)
        return frame

    @classmethod
    def from_frame(
        cls,
        frame: "pd.DataFrame",
        robot: Robot,
        fixed: Mapping[int, float] | None = None,
        wrench: Array | None = None,
    ) -> "Plan":
        """Make a plan from a table with the columns of a file, see `from_csv`.

        Args:
            frame: The table; rows are counted from 1 in messages.
            robot: The robot, which names the columns.
            fixed: Values [rad or m] of joints, by index, that the table may leave out.
            wrench: Default wrench (6,), see `from_csv`.

        Raises:
            PoseFileError: The table is not that of a plan; names the row or column.
        """
        return cls.from_csv(frame, robot, dict(fixed or {}), wrench)

    def to_csv(self, path: Path | str, robot: Robot) -> None:
        """Write the plan to a file, whole or not at all, or to standard output (`-`)."""
        write_text(path, csv_text(self.to_frame(robot)))

    @classmethod
    def from_csv(
        cls, path: Table, robot: Robot, fixed: dict[int, float], wrench: Array | None
    ) -> "Plan":
        """Read a plan: columns q1_deg .. qn_deg, optionally `repeats` and wrench columns.

        Args:
            path: The CSV file, or a data frame that holds what it would; rows are counted from 1
                without the header.
            robot: The robot, which names the columns.
            fixed: Values [rad or m] of joints, by index, that the file may leave out.
            wrench: Default wrench (6,); a wrench column of the file overrides its component. None
                if the file must say which forces are applied.

        Raises:
            UserError: The file is not that of a plan; names the file and the row or column.
        """
        table = PoseTable.read(path, "plan").with_known(robot, (REPEATS,))
        return cls(table.poses(robot, fixed), table.wrenches(wrench), _repeats(table))


def _repeats(table: PoseTable) -> Indices:
    """Repetitions (k,), which default to one where the file has no such column."""
    if "repeats" not in table:
        return np.ones(len(table), dtype=int)
    values = table.numbers("repeats")
    wrong = (values < 1) | (values > MOST_REPEATS) | (values != np.round(values))
    if wrong.any():
        row = int(wrong.argmax())
        raise table.error(
            f"row {row + 1}, column repeats: {values[row]:g} is not a whole number from 1 to 1e9"
        )
    return values.astype(int)
