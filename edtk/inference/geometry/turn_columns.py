"""Orientations of markers in a sheet of positions."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from edtk.inference.geometry.marker_positions import MarkerPositions
from edtk.system.typing import Array, Mask
from edtk.tables.pose_table import PoseTable

VECTOR = ("rx_deg", "ry_deg", "rz_deg")
QUATERNION = ("qw", "qx", "qy", "qz")
UNIT = 0.01  # by how much the length of a quaternion may differ from one


def turn_columns(
    table: PoseTable, names: Sequence[str], joints: Sequence[str], measured: bool = True
) -> dict[str, tuple[str, ...]]:
    """The columns of the orientation of each marker, in the frame of the instrument.

    These are a rotation vector, the axis times the angle in degrees, `rx_deg ry_deg rz_deg`; or a
    quaternion `qw qx qy qz`. In a sheet with a pose a row the marker's name stands before them, as
    before its position; in one with a marker a row nothing does.

    Args:
        table: The sheet.
        names: Markers whose orientations are measured.
        joints: Columns of the joints, which are no orientations: one may be called rx.
        measured: Whether there have to be any.

    Raises:
        PoseFileError: A marker has no such columns.
    """
    found = {}
    for name in names:
        forms = [
            tuple(f"{before}{column}" for column in columns)
            for before in (name, f"{name}_", "")
            for columns in (VECTOR, QUATERNION)
        ]
        there = [
            form
            for form in forms
            if all(column in table and column not in joints for column in form)
        ]
        if there:
            found[name] = there[0]
        elif measured:
            raise table.error(
                f"no orientation of {name}; expected {', '.join(forms[0])} (axis times angle), or "
                f"{', '.join(forms[1])}, as measurement.rows is 'pose'"
            )
    return found


def with_turns(
    table: PoseTable, data: MarkerPositions, columns: Mapping[str, tuple[str, ...]]
) -> MarkerPositions:
    """The positions with the orientations that the sheet has beside them.

    Raises:
        PoseFileError: A cell is no number, or empty beside a position; or a quaternion is none.
    """
    turns = np.full((*data.seen.shape, 3, 3), np.nan)
    for name, own in columns.items():
        marker = data.markers.index(name)
        seen = data.seen[:, marker]
        rows = data.row[seen, marker]
        filled: Mask = np.zeros(len(table), dtype=bool)
        filled[rows] = True
        if set(own) <= set(VECTOR) | set(QUATERNION):
            filled = table.filled(own)  # rows of other markers have theirs in the same columns
            blank = rows[~filled[rows]]
            if len(blank):
                raise table.error("a position without an orientation", f"row {blank[0] + 1}")
        values = table.of_rows(filled).vectors(own)[rows]
        turns[seen, marker] = _matrices(table, values, rows)
    return replace(data, turns=turns)


def _matrices(table: PoseTable, values: Array, rows: Array) -> Array:
    """Rotations (m, 3, 3) of vectors [deg] or quaternions, scalar first."""
    from scipy.spatial.transform import Rotation

    if values.shape[1] == len(VECTOR):
        return np.asarray(Rotation.from_rotvec(np.deg2rad(values)).as_matrix())
    length = np.linalg.norm(values, axis=1)
    wrong = np.flatnonzero(np.abs(length - 1) > UNIT)
    if len(wrong):
        raise table.error(
            f"a quaternion of length {length[wrong[0]]:.4g}; expected one of length 1",
            f"row {rows[wrong[0]] + 1}",
        )
    return np.asarray(Rotation.from_quat(np.roll(values, -1, axis=1)).as_matrix())
