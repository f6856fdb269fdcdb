"""What a measurement sheet says that an instrument has seen change under load."""

import numpy as np

from edtk.system.typing import Array, Mask
from edtk.tables.pose_table import PoseTable
from edtk.tables.sheet_columns import (
    AFTER_COLUMN,
    BEFORE_COLUMN,
    CHANGE_COLUMN,
    DEFLECTION_COLUMNS,
    LOADED_COLUMNS,
    ROTATION_COLUMNS,
    TURN_COLUMN,
    UNLOADED_COLUMNS,
)

# A marker that moves by more than this share of the robot's reach was not moved by its load.
FAR = 0.1

# Halfway, on a logarithmic scale, between positions in millimetres (1e3 times the reach in metres)
# and in micrometres (1e6 times). Larger ones have the wrong unit, which later checks name better
# than as swapped columns.
MICROMETRES = 3e4

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

    Displacements that were measured as such are left to the diagnostics, which know units.
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
