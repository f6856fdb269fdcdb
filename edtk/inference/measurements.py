"""Measured deflections: what a measurement file holds."""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from edtk.inference.correlated_noise import CorrelatedNoise
from edtk.inference.sheet_noise import NOISE_COLUMNS, sheet_noise
from edtk.inference.whiten import RowNoise, std_of
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.frames import cross
from edtk.model.robot import Robot
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices
from edtk.tables.pose_table import PoseTable
from edtk.tables.sheet_columns import (
    DEFLECTION_COLUMNS,
    LOADED_COLUMNS,
    MARKER_COLUMNS,
    ROTATION_COLUMNS,
    SHEET_COLUMNS,
    UNLOADED_COLUMNS,
    VISIT_COLUMN,
)

# A marker that moves by more than this share of the robot's reach was not moved by its load.
FAR = 0.1

# Halfway, on a logarithmic scale, between positions in millimetres (1e3 times the reach in metres)
# and in micrometres (1e6 times). Larger ones have the wrong unit, which later checks name better
# than as swapped columns.
MICROMETRES = 3e4


@dataclass(frozen=True, eq=False)
class Measurements(Presented):
    """Deflections, each with its pose, load, noise and marker; repetitions are rows of their own.

    Attributes:
        q: Joint variables (m, n) [rad or m].
        wrench: Forces and torques (m, 6) at the tool point [N, N m].
        deflection: Measured displacement of the marker, and rotation where it is measured (m, rows)
            [m, rad].
        sigma: Standard deviation of the noise (m, rows) [m, rad].
        marker: Offset (m, 3) of the marker from the tool point, in the tool frame [m].
        covariance: The noise where its errors are correlated, of which sigma is then the standard
            deviation; None where they are independent.
        tracker: The noise of each measurement by itself, where `covariance` has more: motions that
            a visit shares, or errors of the model. None where all noise is of that kind.
        visit: Number (m,) of the visit of its pose, as a sheet states it; None where none does.
        stated: Whether a sheet states the noise of its displacements.
    """

    q: Array
    wrench: Array
    deflection: Array
    sigma: Array
    marker: Array
    covariance: CorrelatedNoise | None = None
    tracker: RowNoise | None = None
    visit: Array | None = None
    stated: bool = False

    def headline(self) -> str:
        """How many measurements of how many poses."""
        coordinates = self.deflection.shape[-1]
        poses = len(np.unique(self.pose))
        return f"{len(self)} measurements of {poses} poses, {coordinates} coordinates each"

    def __len__(self) -> int:
        return len(self.q)

    def __getitem__(self, rows: Indices | slice) -> "Measurements":
        """The chosen measurements."""
        names = (f.name for f in fields(self) if f.name != "stated")
        columns = {name: getattr(self, name) for name in names}
        if self.visit is None and self.marker.any():
            columns["visit"] = self.visits  # Without its other rows a visit is not told any more.
        return replace(self, **{n: c[rows] for n, c in columns.items() if c is not None})

    @property
    def noise(self) -> RowNoise:
        """Standard deviations (m, rows) [m, rad], or the noise where its errors are correlated."""
        return self.sigma if self.covariance is None else self.covariance

    @property
    def own_noise(self) -> RowNoise:
        """The noise of each measurement by itself."""
        return self.noise if self.tracker is None else self.tracker

    @property
    def own_sigma(self) -> Array:
        """Standard deviations (m, rows) of the noise of each measurement by itself [m, rad]."""
        return std_of(self.own_noise)

    @cached_property
    def pose(self) -> Indices:
        """Number (m,) of each row's pose and load, counted from 0 in order of appearance."""
        return row_numbers(self.q, self.wrench)

    @cached_property
    def places(self) -> Indices:
        """Number (m,) of each row's pose, load and marker, counted from 0."""
        return row_numbers(self.q, self.wrench, self.marker)

    @cached_property
    def visits(self) -> Indices:
        """Number (m,) of the visit that each row is of, counted from 0.

        A visit is of one pose and load, and has a number in the sheet. Where a sheet has none,
        repetitions of a marker are visits of their own, and different markers are of the same one:
        the third row of each is of the third visit.
        """
        number = _occurrence(self.places) if self.visit is None else self.visit
        return row_numbers(self.pose[:, None], number[:, None])

    def regressor(self, model: ElastostaticModel) -> Array:
        """Regressors (m, rows, p) of what was measured [m/(rad/(N m))].

        The load acts at the tool point and turns joint j by ``k_j J_tool,j' W``, which moves the
        tool by ``J_tool,j`` times that: by d and about r. A marker at offset o moves by
        ``d + r x o``, so that its column is ``J_marker,j (J_tool,j' W)``.
        """
        if not self.marker.any():
            return model.regressor(self.q, self.wrench)
        frames = model.robot.frames(self.q)
        whole = ElastostaticModel(model.robot, model.unknown, "pose")
        A = whole.regressor_of(frames, self.wrench)  # (p, 6, m)
        linear = A[:, :3]
        angular = A[:, 3:]
        offset = (frames.rotation * self.marker.T[:, None]).sum(axis=0)
        moved = linear + cross(angular, offset[None])
        # A marker on the joint's axis does not move: what remains is rounding, and would pass as
        # information.
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

        Columns: those of the joints; wrenches; ``dx_mm dy_mm dz_mm``, or the marker's unloaded
        position ``x0_mm y0_mm z0_mm`` and its loaded one ``x_mm y_mm z_mm``, in the world frame;
        ``drx_deg dry_deg drz_deg`` where rotations are measured (a small rotation vector in the
        world frame); optionally ``sigma_mm``, or ``sigma_x_mm sigma_y_mm sigma_z_mm`` where axes
        differ, or ``cov_xx_mm2 cov_xy_mm2 cov_xz_mm2 cov_yy_mm2 cov_yz_mm2 cov_zz_mm2`` where a
        tracker states the covariance of each displacement, in the world frame; ``marker_x_mm
        marker_y_mm marker_z_mm``; and ``visit``, a number that readings of one visit share.

        Args:
            path: The CSV file; rows are counted from 1, the header left out.
            robot: Names the columns.
            fixed: Values [rad or m] of joints, by index, that the file may leave out.
            wrench: Default wrench (6,); None where the file must say which forces are applied.
            sigma: Noise (rows,) of each measured row [m, rad], of the difference where positions
                are given; the first three are overridden by the file's.

        Raises:
            PoseFileError: Names the file and the row or column.
        """
        table = PoseTable.read(path, "measurement file").with_known(robot, SHEET_COLUMNS)
        noise, covariance = sheet_noise(table, sigma)
        return cls(
            q=table.poses(robot, fixed),
            wrench=_wrenches(table, wrench),
            deflection=_deflection(table, robot.reach, rotations=len(sigma) == 6),
            sigma=noise,
            marker=_markers(table),
            covariance=covariance,
            visit=table.numbers(VISIT_COLUMN) if VISIT_COLUMN in table else None,
            stated=any(column in table for kind in NOISE_COLUMNS for column in kind),
        )


def row_numbers(*columns: Array | Indices) -> Indices:
    """Numbers (m,) of rows, the same for equal ones, counted from 0 in order of appearance."""
    import pandas as pd

    # Adding zero makes -0.0 equal to 0.0, whose bytes differ.
    keys = pd.util.hash_pandas_object(pd.DataFrame(np.hstack(columns) + 0.0), index=False)
    return np.asarray(pd.factorize(keys)[0])


def _occurrence(number: Indices) -> Indices:
    """How many earlier rows (m,) have the same number."""
    order = np.argsort(number, kind="stable")
    count = np.bincount(number)
    found = np.empty(len(number), dtype=int)
    found[order] = np.arange(len(number)) - np.repeat(np.cumsum(count) - count, count)
    return found


def _wrenches(table: PoseTable, default: Array | None) -> Array:
    """Forces and torques (m, 6) [N, N m], none of them zero."""
    wrenches = table.wrenches(default)
    unloaded = np.flatnonzero(~wrenches.any(axis=1))
    if len(unloaded):
        raise table.error(
            f"row {unloaded[0] + 1}, columns Fx_N to Tz_Nm: the wrench is zero; "
            "expected the load applied"
        )
    return wrenches


def _deflection(table: PoseTable, reach: float, rotations: bool) -> Array:
    """Displacements (m, 3) [m], or with rotations (m, 6) [m, rad]."""
    displacement = _displacement(table)
    _require_near(table, displacement, reach)
    if not displacement.any():
        raise table.error("all measured displacements are zero; expected those that the load made")
    if rotations:
        turned = np.deg2rad(table.vectors(ROTATION_COLUMNS))
        return np.hstack([displacement, turned])
    given = [column for column in ROTATION_COLUMNS if column in table]
    if given:
        raise table.error(
            f"column {given[0]!r}: the study measures positions only (measurement.rows)"
        )
    return displacement


def _displacement(table: PoseTable) -> Array:
    """Displacements (m, 3) [m], measured as such or as the difference of two positions."""
    position_columns = (*UNLOADED_COLUMNS, *LOADED_COLUMNS)
    given = [column for column in DEFLECTION_COLUMNS if column in table]
    positions = [column for column in position_columns if column in table]
    if given and positions:
        raise table.error(
            f"columns {given[0]!r} and {positions[0]!r}: "
            "expected displacements or positions, not both"
        )
    if positions:
        return (table.vectors(LOADED_COLUMNS) - table.vectors(UNLOADED_COLUMNS)) / 1e3
    if not given:
        raise table.error(
            f"column {DEFLECTION_COLUMNS[0]!r} is missing; "
            f"expected {', '.join(DEFLECTION_COLUMNS)}, or {', '.join(position_columns)}"
        )
    return table.vectors(DEFLECTION_COLUMNS) / 1e3


def _require_near(table: PoseTable, displacement: Array, reach: float) -> None:
    """Refuse positions whose difference no load can make: columns were swapped, or frames mixed.

    Displacements that were measured as such are left to the diagnostics, which know units.
    """
    far = np.flatnonzero(np.abs(displacement).max(axis=1) > FAR * reach)
    if not len(far) or LOADED_COLUMNS[0] not in table:
        return
    if np.abs(table.vectors(LOADED_COLUMNS)).max() >= MICROMETRES * reach:
        return
    columns = ", ".join((*UNLOADED_COLUMNS, *LOADED_COLUMNS))
    moved_mm = 1e3 * np.linalg.norm(displacement[far[0]])
    raise table.error(
        f"row {far[0] + 1}, columns {columns}: the marker moved by {moved_mm:.4g} mm under load; "
        "are columns swapped? expected positions without and with load, in the same frame"
    )


def _markers(table: PoseTable) -> Array:
    """Offsets (m, 3) of the markers [m]; zero where the file says nothing of markers."""
    if any(column in table for column in MARKER_COLUMNS):
        return table.vectors(MARKER_COLUMNS) / 1e3
    return np.zeros((len(table), 3))
