"""Other ways of reading the columns of a measurement file."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, permutations, product

import numpy as np

from edtk.calibration.finding import Finding, Kind
from edtk.inference.measurements import Measurements
from edtk.study.study import Study
from edtk.system.typing import Array
from edtk.tables.pose_columns import pose_columns
from edtk.tables.pose_table import WRENCH_COLUMNS
from edtk.tables.sheet_columns import DEFLECTION_COLUMNS, MARKER_COLUMNS, ROTATION_COLUMNS

Reading = tuple[Finding, Measurements]
AXES = "xyz"


def readings(study: Study, data: Measurements) -> Iterator[Reading]:
    """Read the columns in other ways, the likeliest first.

    Args:
        study: Says which joints the file must have.
        data: The measurements as the columns are headed.

    Yields:
        The error of the columns that such a reading assumes, and the measurements read so.
    """
    yield from _displacements(data)
    yield from _joints(study, data)
    yield from _wrenches(data)
    yield from _rotations(data)
    yield from _markers(data)
    yield from _other_axes(data)


def _displacements(data: Measurements) -> Iterator[Reading]:
    """Two displacements are exchanged, or the positions that they come from."""
    for i, j in combinations(range(3), 2):
        other = replace(data, deflection=_exchanged(data.deflection, i, j))
        yield _swapped(DEFLECTION_COLUMNS, i, j, positions=AXES[i] + AXES[j]), other


def _joints(study: Study, data: Measurements) -> Iterator[Reading]:
    """Two joints of one kind are exchanged."""
    kinds = [joint.kind for joint in study.robot.joints]
    free = [j for j in range(study.robot.n) if j not in study.fixed]
    for i, j in combinations(free, 2):
        if kinds[i] == kinds[j]:
            other = replace(data, q=_exchanged(data.q, i, j))
            yield _swapped(pose_columns(study.robot), i, j), other


def _wrenches(data: Measurements) -> Iterator[Reading]:
    """Two forces or two torques are exchanged."""
    for i, j in [*combinations(range(3), 2), *combinations(range(3, 6), 2)]:
        if data.wrench[:, [i, j]].any():
            other = replace(data, wrench=_exchanged(data.wrench, i, j))
            yield _swapped(WRENCH_COLUMNS, i, j), other


def _rotations(data: Measurements) -> Iterator[Reading]:
    """Two rotations are exchanged."""
    for i, j in combinations(range(3, data.deflection.shape[1]), 2):
        other = replace(data, deflection=_exchanged(data.deflection, i, j))
        yield _swapped(ROTATION_COLUMNS, i - 3, j - 3), other


def _markers(data: Measurements) -> Iterator[Reading]:
    """Two offsets of the marker are exchanged, or all of them are in metres."""
    if not data.marker.any():
        return
    for i, j in combinations(range(3), 2):
        other = replace(data, marker=_exchanged(data.marker, i, j))
        yield _swapped(MARKER_COLUMNS, i, j), other
    in_metres = replace(data, marker=1e3 * data.marker)
    yield Finding(Kind.MARKER_UNIT, columns=MARKER_COLUMNS), in_metres


def _other_axes(data: Measurements) -> Iterator[Reading]:
    """Displacements and rotations are those of a frame with the axes permuted or reversed."""
    moved = data.deflection
    for order, signs in product(permutations(range(3)), product((1, -1), repeat=3)):
        axes = zip(order, signs, strict=True)
        expected = tuple(f"{'-' * (sign < 0)}{DEFLECTION_COLUMNS[i]}" for i, sign in axes)
        parts = [moved[:, :3][:, order] * signs]
        if moved.shape[1] == 6:
            # Rotation vectors are axial: a left-handed frame reverses them.
            handed = np.linalg.det(np.eye(3)[list(order)]) * np.prod(signs)
            parts.append(handed * moved[:, 3:][:, order] * signs)
        finding = Finding(Kind.OTHER_AXES, columns=DEFLECTION_COLUMNS, data={"expected": expected})
        yield finding, replace(data, deflection=np.hstack(parts))


def _swapped(columns: Sequence[str], i: int, j: int, positions: str = "") -> Finding:
    """Two columns that were exchanged, or the positions along two axes."""
    pair = (columns[i], columns[j])
    return Finding(Kind.SWAPPED_COLUMNS, columns=pair, data={"positions": positions})


def _exchanged(x: Array, i: int, j: int) -> Array:
    """The same with two columns exchanged."""
    other = x.copy()
    other[:, [i, j]] = x[:, [j, i]]
    return other
