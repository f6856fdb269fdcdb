"""Measured positions of markers with what the controller showed, from a file."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from edtk.model.robot import Robot
from edtk.system.typing import Array
from edtk.tables.pose_table import PoseTable

PLACE = ("x_mm", "y_mm", "z_mm")
MARKER = "marker"
ONLY = "marker"  # name of the marker where the file has no column for it


@dataclass(frozen=True, eq=False)
class PositionTable:
    """A row a measured position.

    Attributes:
        shown: What the controller shows (r, n) [rad or m].
        measured: Positions (r, 3) in the frame of the instrument [m].
        markers: Name of each row's marker.
    """

    shown: Array
    measured: Array
    markers: tuple[str, ...]

    @classmethod
    def read(cls, path: Path | str, robot: Robot) -> "PositionTable":
        """Read a file: joint values as in a plan, `x_mm y_mm z_mm`, and perhaps `marker`.

        Args:
            path: The CSV file.
            robot: Names the joints.

        Raises:
            UserError: The file cannot be read, or is no such table; names the row or column.
        """
        plain = replace(robot, controller=None)  # the file's values are the controller's own
        table = PoseTable.read(path, "file").with_known(plain, (*PLACE, MARKER))
        for column in PLACE:
            if column not in table:
                raise table.error(f"column {column!r} is missing; expected {', '.join(PLACE)}")
        measured = np.stack([table.numbers(column) for column in PLACE], axis=-1) / 1e3
        names = (ONLY,) * len(table)
        if MARKER in table:
            names = tuple(_name(value) for value in np.asarray(table.cells[MARKER]).tolist())
        return cls(table.poses(plain, {}), measured, names)


def _name(value: object) -> str:
    """A marker's name, which may be a number."""
    return f"{value:g}" if isinstance(value, float) else str(value).strip()
