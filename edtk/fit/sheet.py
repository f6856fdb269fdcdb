"""What a measurement sheet says: the instrument of each row, its noise, and what changed."""

from collections.abc import Sequence

import numpy as np

from edtk.fit.correlated_noise import CorrelatedNoise, NotPositiveDefiniteError
from edtk.measure.instruments.sensor import Sensor
from edtk.measure.pose_table import (
    AFTER_COLUMN,
    AXIS_SIGMA_COLUMNS,
    BEFORE_COLUMN,
    CHANGE_COLUMN,
    COVARIANCE_COLUMNS,
    DEFLECTION_COLUMNS,
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
# Places of the upper triangle in the order of the columns, and those of the variances.
ROWS = (0, 0, 0, 1, 1, 2)
COLUMNS = (0, 1, 2, 1, 2, 2)


def sheet_sensors(table: PoseTable, sensors: Sequence[Sensor]) -> Indices:
    """Index (m,) of each row's instrument, by the name in its column `marker`.

    A sheet of a single instrument may leave the column out.

    Args:
        table: The sheet.
        sensors: The instruments of the study.

    Raises:
        PoseFileError: The column is missing, or names an instrument that there is not.
    """
    names = [sensor.name for sensor in sensors]
    if MARKER_NAME_COLUMN not in table:
        if len(sensors) == 1:
            return np.zeros(len(table), dtype=int)
        raise table.error(
            f"column {MARKER_NAME_COLUMN!r} is missing; expected which of {', '.join(names)} each "
            "row is of"
        )
    given = table.texts(MARKER_NAME_COLUMN)
    unknown = next((i for i, name in enumerate(given) if name not in names), None)
    if unknown is not None:
        raise table.error(
            f"no marker {given[unknown]!r} in the study; expected one of {', '.join(names)}",
            f"row {unknown + 1}, column {MARKER_NAME_COLUMN}",
        )
    return np.array([names.index(name) for name in given])


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


# Columns of a change, and of what there was without and with load.
POSITIONS: tuple[tuple[str, ...], ...] = (DEFLECTION_COLUMNS, UNLOADED_COLUMNS, LOADED_COLUMNS)
DISTANCES: tuple[tuple[str, ...], ...] = (
    (CHANGE_COLUMN,),
    (BEFORE_COLUMN,),
    (AFTER_COLUMN,),
)


def sheet_change(
    table: PoseTable,
    reach: float,
    coordinates: int,
    nominal: Array | None = None,
    turn: Mask | None = None,
) -> Array:
    """Changes (m, coordinates) of positions, of positions and rotations, or of distances [m, rad].

    Args:
        table: The sheet, or those of its rows that are of instruments of one kind.
        reach: Reach of the robot [m].
        coordinates: 3 for positions, 6 for poses, 1 for distances.
        nominal: Positions (m, 3) or distances (m, 1) of the rigid robot [m], from which changes
            are counted; None where the unloaded robot was measured too.
        turn: Whether each row (m,) is a single rotation; None where none is.

    Raises:
        PoseFileError: Columns are missing or contradict each other, or positions are too far apart.
    """
    if turn is None:
        if TURN_COLUMN in table:
            raise table.error(f"column {TURN_COLUMN!r}: no row is of a single rotation")
        return _changes(table, reach, coordinates, nominal)
    turned = np.deg2rad(table.of_rows(turn).vectors((TURN_COLUMN,)))
    if turn.all():
        return turned
    return turned + _changes(table.of_rows(~turn), reach, coordinates, nominal)


def _changes(table: PoseTable, reach: float, coordinates: int, nominal: Array | None) -> Array:
    """The same without single rotations."""
    columns = DISTANCES if coordinates == 1 else POSITIONS
    changes, unloaded, loaded = columns
    displacement = _displacement(table, changes, unloaded, loaded, nominal)
    _require_near(table, displacement, reach, unloaded if nominal is None else (), loaded)
    if not displacement.any():
        raise table.error("all measured displacements are zero; expected those that the load made")
    if coordinates == 6:
        turned = np.deg2rad(table.vectors(ROTATION_COLUMNS))
        return np.hstack([displacement, turned])
    given = [column for column in ROTATION_COLUMNS if column in table]
    if given and coordinates == 3:
        raise table.error(
            f"column {given[0]!r}: the study measures positions only (measurement.rows)"
        )
    return displacement


def _displacement(
    table: PoseTable,
    changes: tuple[str, ...],
    unloaded: tuple[str, ...],
    loaded: tuple[str, ...],
    nominal: Array | None,
) -> Array:
    """Changes (m, 3) or (m, 1) [m], measured as such or as the difference of two readings."""
    position_columns = loaded if nominal is not None else (*unloaded, *loaded)
    given = [column for column in changes if column in table]
    positions = [column for column in (*unloaded, *loaded) if column in table]
    if given and positions:
        raise table.error(
            f"columns {given[0]!r} and {positions[0]!r}: "
            "expected displacements or positions, not both"
        )
    if positions and nominal is not None:
        if positions[0] in unloaded:
            raise table.error(
                f"column {positions[0]!r}: the study counts from the nominal robot "
                f"(measurement.reference); expected {', '.join(loaded)} alone"
            )
        return table.vectors(loaded) / 1e3 - nominal
    if positions:
        return (table.vectors(loaded) - table.vectors(unloaded)) / 1e3
    if not given:
        raise table.error(
            f"column {changes[0]!r} is missing; "
            f"expected {', '.join(changes)}, or {', '.join(position_columns)}"
        )
    return table.vectors(changes) / 1e3


def _require_near(
    table: PoseTable,
    displacement: Array,
    reach: float,
    unloaded: tuple[str, ...],
    loaded: tuple[str, ...],
) -> None:
    """Refuse positions whose difference no load can make: columns were swapped, or frames mixed.

    Displacements that were measured as such are left to the findings, which know units.
    """
    far = np.flatnonzero(np.abs(displacement).max(axis=1) > FAR * reach)
    if not len(far) or loaded[0] not in table:
        return
    if np.abs(table.vectors(loaded)).max() >= MICROMETRES * reach:
        return
    columns = ", ".join((*unloaded, *loaded))
    moved_mm = 1e3 * np.linalg.norm(displacement[far[0]])
    if not unloaded:
        raise table.error(
            f"row {far[0] + 1}, columns {columns}: {moved_mm:.4g} mm from the nominal robot; "
            "expected positions in the world frame of the study"
        )
    raise table.error(
        f"row {far[0] + 1}, columns {columns}: the marker moved by {moved_mm:.4g} mm under load; "
        "are columns swapped? expected positions without and with load, in the same frame"
    )


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
