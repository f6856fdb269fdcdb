"""Measured deflections: what a measurement file holds."""

from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.frames import cross
from edtk.model.robot import Robot
from edtk.tables.pose_table import PoseTable
from edtk.tables.sheet_columns import (
    DEFLECTION_COLUMNS,
    LOADED_COLUMNS,
    MARKER_COLUMNS,
    ROTATION_COLUMNS,
    SHEET_COLUMNS,
    UNLOADED_COLUMNS,
)

Array = NDArray[np.float64]
LEAST_MM = 1e-9  # standard deviation that can be meant


@dataclass(frozen=True, eq=False)
class Measurements:
    """Deflections, each with its pose, load, noise and marker; repetitions are rows of their own.

    Attributes:
        q: Joint variables (m, n) [rad or m].
        wrench: Forces and torques (m, 6) at the tool point [N, N m].
        deflection: Measured displacement of the marker, and rotation where it is measured (m, rows) [m, rad].
        sigma: Standard deviation of the noise (m, rows) [m, rad].
        marker: Offset (m, 3) of the marker from the tool point, in the tool frame [m].
    """

    q: Array
    wrench: Array
    deflection: Array
    sigma: Array
    marker: Array

    def __len__(self) -> int:
        return len(self.q)

    def __getitem__(self, rows: NDArray[np.int_] | slice) -> "Measurements":
        """Some of them."""
        return Measurements(*(getattr(self, f.name)[rows] for f in fields(self)))

    @cached_property
    def pose(self) -> NDArray[np.int_]:
        """Number (m,) of each row's pose and load, counted from 0 in order of appearance."""
        return row_numbers(self.q, self.wrench)

    def regressor(self, model: ElastostaticModel) -> Array:
        """Regressors (m, rows, p) of what was measured.

        The load acts at the tool point and turns joint j by ``k_j J_tool,j' W``, which moves the tool by
        ``J_tool,j`` times that: by d and about r. A marker at offset o moves by ``d + r x o``, so that its column is
        ``J_marker,j (J_tool,j' W)``.
        """
        if not self.marker.any():
            return model.regressor(self.q, self.wrench)
        frames = model.robot.frames(self.q)
        A = ElastostaticModel(model.robot, model.unknown, "pose").regressor_of(
            frames, self.wrench
        )  # (p, 6, m)
        offset = (frames.rotation * self.marker.T[:, None]).sum(axis=0)
        linear, angular = A[:, :3], A[:, 3:]
        moved = linear + cross(angular, offset[None])
        # A marker on the joint's axis does not move: what is left is rounding, and would pass as information.
        size = model.robot.reach + np.linalg.norm(self.marker, axis=1)
        lost = 64 * np.finfo(float).eps * size * np.abs(angular).sum(axis=1, keepdims=True)
        moved = np.where(np.abs(moved) <= lost, 0.0, moved)
        if model.rows == "pose":
            moved = np.concatenate([moved, angular], axis=1)
        return np.moveaxis(moved, (0, 1), (-1, -2))

    @classmethod
    def from_csv(
        cls,
        path: Path | str,
        robot: Robot,
        fixed: dict[int, float],
        wrench: Array | None,
        sigma: Array,
    ) -> "Measurements":
        """Read a measurement file.

        Columns: those of the joints; wrenches; ``dx_mm dy_mm dz_mm``, or the marker's unloaded position
        ``x0_mm y0_mm z0_mm`` and its loaded one ``x_mm y_mm z_mm``, in the world frame; ``drx_deg dry_deg drz_deg``
        where rotations are measured (a small rotation vector in the world frame); optionally ``sigma_mm`` and
        ``marker_x_mm marker_y_mm marker_z_mm``.

        Args:
            path: The CSV file; rows are counted from 1, the header left out.
            robot: Names the columns.
            fixed: Values [rad or m] of joints, by index, that the file may leave out.
            wrench: Default wrench (6,); None where the file must say which forces are applied.
            sigma: Noise (rows,) of each measured row [m, rad], of the difference where positions are given; the first
                three are overridden by ``sigma_mm``.

        Raises:
            PoseFileError: Names the file and the row or column.
        """
        table = PoseTable.read(path, "measurement file")
        table.require_known(robot, SHEET_COLUMNS)
        q, W = table.poses(robot, fixed), table.wrenches(wrench)
        if len(rows := np.flatnonzero(~W.any(axis=1))):
            raise table.error(
                f"row {rows[0] + 1}, columns Fx_N to Tz_Nm: the wrench is zero; expected the load applied"
            )
        deflection = _position(table)
        far = np.flatnonzero(np.abs(deflection).max(axis=1) > 0.1 * robot.reach)
        if (
            len(far)
            and LOADED_COLUMNS[0] in table
            and np.abs(_vector(table, LOADED_COLUMNS)).max() < 3e4 * robot.reach
        ):
            raise table.error(
                f"row {far[0] + 1}, columns {', '.join((*UNLOADED_COLUMNS, *LOADED_COLUMNS))}: the marker moved by "
                f"{1e3 * np.linalg.norm(deflection[far[0]]):.4g} mm under load; are columns swapped? expected "
                "positions without and with load, in the same frame"
            )
        if not deflection.any():
            raise table.error(
                "all measured displacements are zero; expected those that the load made"
            )
        turned = [c for c in ROTATION_COLUMNS if c in table]
        if len(sigma) == 6:
            deflection = np.hstack([deflection, np.deg2rad(_vector(table, ROTATION_COLUMNS))])
        elif turned:
            raise table.error(
                f"column {turned[0]!r}: the study measures positions only (measurement.rows)"
            )
        noise = np.tile(sigma, (len(table), 1))
        if "sigma_mm" in table:
            noise[:, :3] = _positive(table, "sigma_mm")[:, None] / 1e3
        marked = any(c in table for c in MARKER_COLUMNS)
        marker = _vector(table, MARKER_COLUMNS) / 1e3 if marked else np.zeros((len(table), 3))
        return cls(q, W, deflection, noise, marker)


def row_numbers(*columns: Array) -> NDArray[np.int_]:
    """Numbers (m,) of rows, the same for equal ones, counted from 0 in order of appearance."""
    keys = pd.util.hash_pandas_object(pd.DataFrame(np.hstack(columns) + 0.0), index=False)
    return np.asarray(pd.factorize(keys)[0])


def _vector(table: PoseTable, columns: tuple[str, ...]) -> Array:
    """Three columns (m, 3), none of which may be missing."""
    missing = [c for c in columns if c not in table]
    if missing:
        raise table.error(f"column {missing[0]!r} is missing; expected {', '.join(columns)}")
    return np.stack([table.numbers(c) for c in columns], axis=-1)


def _position(table: PoseTable) -> Array:
    """Displacements (m, 3) [m], measured as such or as the difference of two positions."""
    given = [c for c in DEFLECTION_COLUMNS if c in table]
    positions = [c for c in (*UNLOADED_COLUMNS, *LOADED_COLUMNS) if c in table]
    if given and positions:
        raise table.error(
            f"columns {given[0]!r} and {positions[0]!r}: expected displacements or positions, not both"
        )
    if positions:
        return (_vector(table, LOADED_COLUMNS) - _vector(table, UNLOADED_COLUMNS)) / 1e3
    if not given:
        raise table.error(
            f"column {DEFLECTION_COLUMNS[0]!r} is missing; expected {', '.join(DEFLECTION_COLUMNS)}, "
            f"or {', '.join((*UNLOADED_COLUMNS, *LOADED_COLUMNS))}"
        )
    return _vector(table, DEFLECTION_COLUMNS) / 1e3


def _positive(table: PoseTable, column: str) -> Array:
    """One column of positive numbers."""
    values = table.numbers(column)
    if len(rows := np.flatnonzero(values < LEAST_MM)):
        raise table.error(
            f"row {rows[0] + 1}, column {column}: {values[rows[0]]:g} is not a positive number of at least {LEAST_MM:g}"
        )
    return values
