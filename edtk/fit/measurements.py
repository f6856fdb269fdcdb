"""Measured deflections: what a measurement file holds."""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from edtk.fit.correlated_noise import (
    AnyNoise,
    CorrelatedNoise,
    RowNoise,
    occurrence,
    row_numbers,
    std_of,
)
from edtk.fit.sheet import (
    BY_ROWS,
    DISTANCE,
    NOISE_COLUMNS,
    POSITION,
    Readings,
    Reference,
    first_far,
    read_by,
    read_turns,
    require_loads,
    require_positions_alone,
    sheet_instruments,
    sheet_markers,
    sheet_noise,
    sheet_turns,
    stated_sigma,
)
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import Rest
from edtk.measure.instruments.marker import Marker
from edtk.measure.instruments.one_row import OneRow, whole_of
from edtk.measure.instruments.pose_marker import COORDINATES, PoseMarker
from edtk.measure.instruments.sensor import Sensor
from edtk.measure.model_error import ModelError, groups_of
from edtk.measure.pose_table import (
    FINISHED_BY,
    MARKER_NAME_COLUMN,
    ROTATION_COLUMNS,
    SHEET_COLUMNS,
    VISIT_COLUMN,
    PoseTable,
    Table,
    finished_rows,
)
from edtk.robots.frames import BodyPoint, Frames
from edtk.robots.robot import Robot
from edtk.robots.rotations import without_rounding
from edtk.system.presented import Presented
from edtk.system.typing import Array, Indices, Mask


@dataclass(frozen=True, eq=False)
class Measurements(Presented):
    """Deflections, each with its pose, load, noise and marker; repetitions are rows of their own.

    Attributes:
        q: Joint variables (m, n) [rad or m].
        wrench: Forces and torques (m, 6) at the load point [N, N m].
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
        sensor: Index (m,) of each row's instrument in the model, whose point it measures and in
            whose body's frame the marker's offset is; None where all rows are of the tool.
        turn: Whether each row (m,) is a single rotation; None where none is.
        absolute: Whether displacements are counted from the rigid robot, not the unloaded one.
        unloaded: Positions (m, 3) without the load, where the sheet has them [m]; None elsewhere.
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
    sensor: Indices | None = None
    turn: Mask | None = None
    absolute: bool = False
    unloaded: Array | None = None

    def headline(self) -> str:
        """How many measurements of how many poses."""
        coordinates = self.deflection.shape[-1]
        poses = len(np.unique(self.pose))
        return f"{len(self)} measurements of {poses} poses, {coordinates} coordinates each"

    def __len__(self) -> int:
        return len(self.q)

    def __getitem__(self, rows: Indices | slice) -> "Measurements":
        """The chosen measurements."""
        names = (f.name for f in fields(self) if f.name not in ("stated", "absolute"))
        columns = {name: getattr(self, name) for name in names}
        if self.visit is None and not self.alone:
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
    def lengths(self) -> Mask:
        """Whether each measured coordinate (m, rows) is a length; the others are rotations."""
        m, rows = self.sigma.shape
        found = np.broadcast_to(np.arange(rows) < COORDINATES, (m, rows))
        return found if self.turn is None else found & ~self.turn[:, None]

    @cached_property
    def pose(self) -> Indices:
        """Number (m,) of each row's pose and load, counted from 0 in order of appearance."""
        return row_numbers(self.q, self.wrench)

    @cached_property
    def places(self) -> Indices:
        """Number (m,) of each row's pose, load, instrument and marker, counted from 0."""
        instrument = [] if self.sensor is None else [self.sensor[:, None]]
        return row_numbers(self.q, self.wrench, self.marker, *instrument)

    @property
    def alone(self) -> bool:
        """Whether each row is a visit of its own, as one point is measured and none is numbered."""
        return self.visit is None and self.sensor is None and not self.marker.any()

    @cached_property
    def visits(self) -> Indices:
        """Number (m,) of the visit that each row is of, counted from 0.

        A visit is of one pose and load, and has a number in the sheet. Where a sheet has none,
        repetitions of a marker are visits of their own, and different markers are of the same one:
        the third row of each is of the third visit.
        """
        number = occurrence(self.places) if self.visit is None else self.visit
        return row_numbers(self.pose[:, None], number[:, None])

    def instruments(self, model: ElastostaticModel) -> Iterator[tuple[Indices, Sensor]]:
        """The instruments that have measured some rows, each with these rows and its point there.

        Args:
            model: Says what is measured.
        """
        if self.sensor is None:
            kind = Marker if model.rows == "position" else PoseMarker
            yield np.arange(len(self)), kind(BodyPoint(self.marker.T))
            return
        for index in np.unique(self.sensor):
            rows = np.flatnonzero(self.sensor == index)
            sensor = model.instruments[index]
            yield rows, sensor.at(replace(sensor.point, offset=self.marker[rows].T))

    def regressor(self, model: ElastostaticModel) -> Array:
        """Regressors (m, rows, p) of what was measured [m/(rad/(N m))].

        The load acts at the tool point and turns joint j by ``k_j J_tool,j' W``, which moves the
        tool by ``J_tool,j`` times that: by d and about r. A marker at offset o moves by
        ``d + r x o``, so that its column is ``J_marker,j (J_tool,j' W)``. That a compensator takes
        a part of that is left to the loaded equilibrium.
        """
        return self.regressor_of(model, model.frames(self.q), self.wrench)

    def regressor_of(self, model: ElastostaticModel, frames: Frames, wrench: Array) -> Array:
        """The same of another chain under other loads.

        Args:
            model: Says what is measured.
            frames: The chain in the pose of each row.
            wrench: Forces and torques (m, 6) at the load point [N, N m].
        """
        if self.sensor is None and model.is_plain and not self.marker.any():
            plain = model if model.gives is None else replace(model, gives=None)
            return np.moveaxis(plain.regressor_of(frames, wrench), (0, 1), (-1, -2))
        torque = model.torque_of(frames, wrench)[model.joints]
        motion = self.motion_of(model, frames)[model.joints]
        # Poses stay contiguous, as the model makes them: another layout sums in another order.
        return np.moveaxis(motion * torque[:, None], (0, 1), (-1, -2))

    def motion_of(self, model: ElastostaticModel, frames: Frames) -> Array:
        """Derivatives (n, rows, m) of what each row measures by all joints, component first.

        Args:
            model: Says what is measured.
            frames: The robot in the pose of each row.
        """
        motion = np.empty((model.robot.n, self.deflection.shape[1], len(self)))
        for rows, sensor in self.instruments(model):
            own = frames if len(rows) == len(self) else frames[rows]
            size = model.reach_of(sensor.point)
            motion[..., rows] = without_rounding(own.folded(sensor.motion(own)), size)
        return motion

    def whole_rows(self, model: ElastostaticModel, A: Array) -> tuple[Array, Indices | None]:
        """Regressors of the vectors that rows are coordinates of.

        Args:
            model: Says what is measured.
            A: The regressors (m, rows, p) of the rows.

        Returns:
            Regressors (m, v, 3, p) of v vectors of each row: its displacement, and its rotation
            where both are measured. And the coordinate (m,) that a row of a single one is of its
            vector, -1 for a distance; None where rows are whole.
        """
        m, rows, p = A.shape
        if rows > 1:
            return A.reshape(m, rows // 3, 3, p), None
        whole = np.zeros((m, 1, 3, p))
        own = np.full(m, -1)
        frames = model.frames(self.q)
        torque = model.torque_of(frames, self.wrench)[model.joints]
        for members, sensor in self.instruments(model):
            if isinstance(sensor, OneRow):
                first = sensor.row // 3 * 3
                part = frames[members]
                motion = part.folded(sensor.whole.motion(part))[model.joints, first : first + 3]
                whole[members, 0] = np.moveaxis(motion * torque[:, None, members], (0, 1), (-1, -2))
                own[members] = sensor.row % 3
        return whole, own

    def rigid(self, model: ElastostaticModel) -> Array:
        """What the rigid robot would show: positions (m, 3), or lengths (m, 1), else zero [m]."""
        return self.rigid_of(model, model.frames(self.q))

    def rigid_of(self, model: ElastostaticModel, frames: Frames) -> Array:
        """The same of another chain in the pose of each row."""
        found = np.zeros((len(self), min(self.deflection.shape[1], COORDINATES)))
        for rows, sensor in self.instruments(model):
            if sensor.lengths.any():
                found[rows] = sensor.place(frames[rows]).T
        return found

    def changes(self, model: ElastostaticModel, rest: Rest) -> Array:
        """What the instruments would have shown (m, rows) of a robot at rest [m, rad].

        Args:
            model: Says what is measured.
            rest: The robot in each distinct pose, in the order of `pose`.
        """
        before = model.frames(rest.start)
        after = model.frames(rest.end)
        found = np.empty_like(self.deflection)
        for rows, sensor in self.instruments(model):
            pose = self.pose[rows]
            found[rows] = sensor.change(before[pose], after[pose]).T
        return found

    @classmethod
    def from_csv(
        cls,
        path: Table,
        robot: Robot,
        fixed: dict[int, float],
        wrench: Array | None,
        sigma: Array,
        model: ElastostaticModel | None = None,
        nominal: bool = False,
    ) -> "Measurements":
        """Read a measurement file.

        Columns: those of the joints; wrenches; ``dx_mm dy_mm dz_mm``, or the marker's unloaded
        position ``x0_mm y0_mm z0_mm`` and its loaded one ``x_mm y_mm z_mm``, in the world frame;
        ``drx_deg dry_deg drz_deg`` where rotations are measured (a small rotation vector in the
        world frame); optionally ``sigma_mm``, or ``sigma_x_mm sigma_y_mm sigma_z_mm`` where axes
        differ, or ``cov_xx_mm2 cov_xy_mm2 cov_xz_mm2 cov_yy_mm2 cov_yz_mm2 cov_zz_mm2`` where a
        tracker states the covariance of each displacement, in the world frame; ``marker_x_mm
        marker_y_mm marker_z_mm``; and ``visit``, a number that readings of one visit share.
        Where a study has several instruments, ``marker`` names that of a row; a distance has
        ``change_mm``, or ``before_mm after_mm``, and so has a coordinate where instruments of
        several kinds have a row for each; a rotation then has ``rotation_change_deg``.

        Args:
            path: The CSV file, or a data frame that holds what it would; rows are counted from 1,
                the header left out. Rows that are not filled in yet are left out, with a note.
            robot: Names the columns.
            fixed: Values [rad or m] of joints, by index, that the file may leave out.
            wrench: Default wrench (6,); None where the file must say which forces are applied.
            sigma: Noise (rows,) of each measured row [m, rad], of the difference where positions
                are given, one instrument after another; the sheet may override it.
            model: Says what is measured; the tool point by default.
            nominal: Whether displacements are counted from the rigid robot of the model, so that a
                sheet of positions has no unloaded ones.

        Raises:
            PoseFileError: Names the file and the row or column.
        """
        table = PoseTable.read(path, "measurement file").with_known(robot, SHEET_COLUMNS)
        table = finished_rows(table)
        empty = cls._of_rows(table, robot, fixed, wrench, sigma, model, nominal)
        return empty._with_changes(table, robot, model)

    @classmethod
    def expected(
        cls,
        table: PoseTable,
        robot: Robot,
        fixed: dict[int, float],
        wrench: Array | None,
        sigma: Array,
        model: ElastostaticModel,
        nominal: bool = False,
    ) -> tuple["Measurements", Indices]:
        """What instruments will read in the poses of a file, some of which may be measured.

        A file of nothing but poses has all instruments of the model in each of them.

        Args:
            table: The file, which has a row at least, with columns as in `from_csv`.
            robot: Names the columns.
            fixed: Values [rad or m] of joints, by index, that the file may leave out.
            wrench: Default wrench (6,); None where the file must say which forces are applied.
            sigma: Noise (rows,) of each measured row [m, rad].
            model: Says what is measured.
            nominal: Whether displacements are counted from the rigid robot of the model.

        Returns:
            The readings, NaN where a cell is to be filled in; and the row of the file (m,) that
            each is of, counted from 0.

        Raises:
            PoseFileError: Names the file and the row or column.
        """
        table = table.with_known(robot, SHEET_COLUMNS)
        columns = tuple(column for column in FINISHED_BY if column in table)
        filled = table.filled(columns) if columns else np.zeros(len(table), dtype=bool)
        rows = np.arange(len(table))
        index = None
        several = len(model.sensors)
        if several > 1 and not filled.any() and MARKER_NAME_COLUMN not in table:
            index = np.tile(np.arange(several), len(table))
            rows = np.repeat(rows, several)
            table = table.of_some(rows)
            filled = filled[rows]
        empty = cls._of_rows(table, robot, fixed, wrench, sigma, model, nominal, index)
        deflection = np.full_like(empty.deflection, np.nan)
        if filled.any():
            some = empty[np.flatnonzero(filled)]
            deflection[filled] = some._with_changes(table.of_some(filled), robot, model).deflection
        return replace(empty, deflection=deflection), rows

    @classmethod
    def _of_rows(
        cls,
        table: PoseTable,
        robot: Robot,
        fixed: dict[int, float],
        wrench: Array | None,
        sigma: Array,
        model: ElastostaticModel | None,
        nominal: bool,
        index: Indices | None = None,
    ) -> "Measurements":
        """The rows of a table with displacements of zero; `index` says their instruments."""
        q = table.poses(robot, fixed)
        sensors = () if model is None else model.sensors
        if sensors and index is None:
            index, _ = sheet_instruments(table, [sensor.name for sensor in sensors])
        sigma = stated_sigma(sigma, sensors, index)
        turn = sheet_turns(sensors, index)
        noise, covariance = sheet_noise(table, sigma, turn)
        wrenches = table.wrenches(wrench)
        if model is None or model.weights is None:  # weights load the robot, too
            require_loads(table, wrenches, np.ones(len(table), dtype=bool))
        return cls(
            q=q,
            wrench=wrenches,
            deflection=np.zeros_like(noise),
            sigma=noise,
            marker=sheet_markers(table, sensors, index),
            covariance=covariance,
            visit=table.numbers(VISIT_COLUMN) if VISIT_COLUMN in table else None,
            stated=any(column in table for kind in NOISE_COLUMNS for column in kind),
            sensor=index,
            turn=turn,
            absolute=nominal,
        )

    def _with_changes(
        self, table: PoseTable, robot: Robot, model: ElastostaticModel | None
    ) -> "Measurements":
        """The same with the displacements of a table."""
        coordinates = self.sigma.shape[1]
        kinds = read_by(() if model is None else model.sensors) or (BY_ROWS[coordinates],)
        index = np.zeros(len(self), dtype=int) if self.sensor is None else self.sensor
        reference: Reference = "nominal" if self.absolute else "unloaded"
        found = Readings.of(table, kinds, index, robot.reach, reference)
        moved = found.value[:, : min(coordinates, COORDINATES)]
        if model is not None and self.absolute:
            rigid = np.where(found.differs[:, None], 0.0, self.rigid(model))
            _require_in_world(table, moved, rigid, robot.reach)
            moved = moved - rigid
        if not moved[self.lengths[:, 0]].any() and self.lengths.any():
            message = "all measured displacements are zero; expected those that the load made"
            raise table.error(message)
        if coordinates > COORDINATES:
            moved = np.hstack([moved, read_turns(table, np.arange(len(self)), ROTATION_COLUMNS)])
        elif coordinates == COORDINATES:
            require_positions_alone(table)
        unloaded = found.unloaded
        alone = self.sensor is None and not self.absolute and np.isfinite(unloaded).all()
        return replace(self, deflection=moved, unloaded=unloaded if alone else None)


def _require_in_world(table: PoseTable, read: Array, rigid: Array, reach: float) -> None:
    """Check that readings (m, c) are near those of the rigid robot, which are zero for changes.

    Raises:
        PoseFileError: One is far from it.
    """
    is_read = rigid.any(axis=1, keepdims=True)
    moved = np.where(is_read, read - rigid, np.nan)
    row = first_far(moved, read, reach)
    if row is not None:
        columns = ", ".join(POSITION.loaded if read.shape[1] > 1 else DISTANCE.loaded)
        raise table.error(
            f"{1e3 * np.linalg.norm(moved[row]):.4g} mm from the nominal robot; "
            "expected positions in the world frame of the study",
            f"row {row + 1}, columns {columns}",
        )


def measured_points(model: ElastostaticModel, data: Measurements) -> Array:
    """Positions (m, 3) of the points in the poses of each row, without any load [m].

    Args:
        model: Says what is measured.
        data: Poses and instruments.
    """
    frames = model.frames(data.q)
    found = np.empty((len(data), 3))
    for rows, sensor in data.instruments(model):
        found[rows] = sensor.point.position(frames[rows]).T
    return found


def joint_motion(model: ElastostaticModel, data: Measurements) -> Array:
    """Derivatives (m, rows, n) of the measured rows by all joints [m/rad, or 1].

    Columns of the regressor are these, times the loads of the joints: so whatever the model
    explains of a visit is a motion of the joints.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: Poses, instruments and markers.
    """
    motion = data.motion_of(model, model.frames(data.q))
    return np.ascontiguousarray(np.moveaxis(motion, (0, 1), (-1, -2)))


def model_errors(
    model: ElastostaticModel, data: Measurements, error: ModelError
) -> tuple[Array, Array]:
    """What the model leaves out of each row: shared by a visit's instruments, and row by row.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: Poses, loads, instruments and markers.
        error: Its shares.

    Returns:
        A root (m, rows, n) of the part in the springs' turns, which move all rows of a pose under a
        load together; and standard deviations (m, rows) of that in any direction [m, rad].
    """
    frames = model.frames(data.q)
    torque = model.torque_of(frames, data.wrench)
    roots = np.empty((*data.deflection.shape, model.robot.n))
    sizes = np.empty(data.deflection.shape)
    for rows, sensor in data.instruments(model):
        own = frames[rows]
        whole, seen = whole_of(sensor)
        bends = error.bends(own.folded(whole.motion(own)), torque[:, rows])
        roots[rows] = np.moveaxis(error.turns(bends)[:, seen], (0, 1), (-1, -2))
        sizes[rows] = error.sizes(bends, groups_of((whole,)))[seen].T
    return roots, sizes


def translations(model: ElastostaticModel, data: Measurements) -> Array:
    """Derivatives (m, rows, 3) of the readings where the robot moves along the world's axes.

    Args:
        model: Says what is measured.
        data: Poses and instruments.
    """
    frames = model.frames(data.q)
    found = np.empty((*data.deflection.shape, 3))
    for rows, sensor in data.instruments(model):
        found[rows] = np.moveaxis(sensor.translation(frames[rows]), -1, 0)
    return found


def simulate(
    A: Array, k: ArrayLike, sigma: AnyNoise, rng: np.random.Generator, runs: int = 1
) -> Array:
    """Draw measurements of a plan, Eq. (10): ``dp_i = A_i k0 + eps_i`` with normal noise.

    Args:
        A: Regressors (m, rows, p), one a measurement [m/(rad/(N m))].
        k: True compliances k0 (p,) [rad/(N m)].
        sigma: Standard deviation of the noise, one number or one a row (rows,) [m, rad]; or
            correlated noise of the m measurements.
        rng: Source of randomness.
        runs: How many times the plan is carried out.

    Returns:
        Deflections (runs, m, rows) [m, rad], with errors that are independent but for
        what the noise correlates.
    """
    clean = A @ np.asarray(k, dtype=float)
    z = rng.standard_normal((runs, *clean.shape))
    if isinstance(sigma, CorrelatedNoise):
        return clean + sigma.colour(z)
    return clean + np.asarray(sigma) * z
