"""Other ways of reading the columns of a measurement file."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, combinations, permutations, product

import numpy as np

from edtk.calibration.finding import Finding, Kind
from edtk.calibration.input_errors.reading import Reading
from edtk.inference.measurements import Measurements
from edtk.inference.row_numbers import row_numbers
from edtk.study.study import Study
from edtk.system.typing import Array, Indices
from edtk.tables.pose_columns import pose_columns
from edtk.tables.pose_table import WRENCH_COLUMNS
from edtk.tables.sheet_columns import DEFLECTION_COLUMNS, MARKER_COLUMNS, ROTATION_COLUMNS

AXES = "xyz"
MOST_MARKERS = 6  # of which each two may be exchanged
OFFSETS_DEG = (90, -90, 180)  # by which zeros of joints differ between conventions


def readings(study: Study, data: Measurements, only_signs: bool = False) -> Iterator[Reading]:
    """Read the columns in other ways, the likeliest first.

    Args:
        study: Says which joints the file must have.
        data: The measurements as the columns are headed.
        only_signs: Whether only signs and axes of the displacements are read in other ways.
    """
    yield Reading(Finding(Kind.WRONG_SIGN), replace(data, deflection=-data.deflection))
    directed = data.deflection.shape[1] > 1  # distances have no axes to exchange
    if not only_signs:
        if directed:
            yield from _displacements(data)
        yield from _joint_signs(study, data)
        yield from _joints(study, data)
        yield from _wrenches(data)
        yield from _wrench_signs(data)
        yield from _rotations(data)
        yield from _markers(data)
        yield from _swapped_markers(study, data)
    if directed:
        yield from _other_axes(data)
    if not only_signs:
        yield from _joint_offsets(study, data)


def _displacements(data: Measurements) -> Iterator[Reading]:
    """Two displacements are exchanged, or the positions that they come from."""
    for i, j in combinations(range(3), 2):
        other = replace(data, deflection=_exchanged(data.deflection, i, j))
        yield Reading(_swapped(DEFLECTION_COLUMNS, i, j, positions=AXES[i] + AXES[j]), other)


def _joint_signs(study: Study, data: Measurements) -> Iterator[Reading]:
    """One or two joints are counted the other way round."""
    columns = pose_columns(study.robot)
    robot = study.robot
    free = [j for j in _free(study) if robot.shown(data.q)[:, j].any()]
    for turned in chain(combinations(free, 1), combinations(free, 2)):
        shown = robot.shown(data.q).copy()
        shown[:, turned] *= -1
        q = robot.of_shown(shown)
        finding = Finding(Kind.OPPOSITE_SIGN, columns=tuple(columns[j] for j in turned))
        yield Reading(finding, replace(data, q=q))


def _joints(study: Study, data: Measurements) -> Iterator[Reading]:
    """Two joints of one kind are exchanged."""
    kinds = [joint.kind for joint in study.robot.joints]
    for i, j in combinations(_free(study), 2):
        if kinds[i] == kinds[j]:
            shown = _exchanged(study.robot.shown(data.q), i, j)
            other = replace(data, q=study.robot.of_shown(shown))
            yield Reading(_swapped(pose_columns(study.robot), i, j), other)


def _joint_offsets(study: Study, data: Measurements) -> Iterator[Reading]:
    """One joint is counted from another zero."""
    columns = pose_columns(study.robot)
    revolute = [j for j in _free(study) if study.robot.joints[j].kind == "revolute"]
    for j, degrees in product(revolute, OFFSETS_DEG):
        shown = study.robot.shown(data.q).copy()
        shown[:, j] += np.deg2rad(degrees)
        q = study.robot.of_shown(shown)
        offset = {"degrees": degrees}
        finding = Finding(Kind.JOINT_OFFSET, columns=(columns[j],), data=offset)
        yield Reading(finding, replace(data, q=q))


def _wrenches(data: Measurements) -> Iterator[Reading]:
    """Two forces or two torques are exchanged."""
    for i, j in [*combinations(range(3), 2), *combinations(range(3, 6), 2)]:
        if data.wrench[:, [i, j]].any():
            other = replace(data, wrench=_exchanged(data.wrench, i, j))
            yield Reading(_swapped(WRENCH_COLUMNS, i, j), other)


def _wrench_signs(data: Measurements) -> Iterator[Reading]:
    """A force or torque beside others has the opposite sign."""
    acting = np.flatnonzero(data.wrench.any(axis=0))
    for i in acting if len(acting) > 1 else ():
        wrench = data.wrench.copy()
        wrench[:, i] *= -1
        finding = Finding(Kind.OPPOSITE_SIGN, columns=(WRENCH_COLUMNS[i],))
        yield Reading(finding, replace(data, wrench=wrench))


def _rotations(data: Measurements) -> Iterator[Reading]:
    """Two rotations are exchanged, or all of them have the opposite sign."""
    if data.deflection.shape[1] == 6:
        turned = data.deflection * np.repeat([1, -1], 3)
        finding = Finding(Kind.OPPOSITE_SIGN, columns=ROTATION_COLUMNS)
        yield Reading(finding, replace(data, deflection=turned))
    for i, j in combinations(range(3, data.deflection.shape[1]), 2):
        other = replace(data, deflection=_exchanged(data.deflection, i, j))
        yield Reading(_swapped(ROTATION_COLUMNS, i - 3, j - 3), other)


def _markers(data: Measurements) -> Iterator[Reading]:
    """Two offsets of the marker are exchanged, or all of them are in metres."""
    if not data.marker.any():
        return
    for i, j in combinations(range(3), 2):
        other = replace(data, marker=_exchanged(data.marker, i, j))
        yield Reading(_swapped(MARKER_COLUMNS, i, j), other)
    in_metres = replace(data, marker=1e3 * data.marker)
    yield Reading(Finding(Kind.MARKER_UNIT, columns=MARKER_COLUMNS), in_metres)


def _swapped_markers(study: Study, data: Measurements) -> Iterator[Reading]:
    """Two markers, or other instruments of one kind, are exchanged in all rows."""
    index = np.zeros(len(data), dtype=int) if data.sensor is None else data.sensor
    which = row_numbers(index[:, None], data.marker)
    first = np.unique(which, return_index=True)[1]
    if not 1 < len(first) <= MOST_MARKERS:
        return
    model = study.model
    for i, j in combinations(range(len(first)), 2):
        a, b = first[[i, j]]
        if type(model.instruments[index[a]]) is not type(model.instruments[index[b]]):
            continue
        row = np.arange(len(data))
        row = np.where(which == i, b, np.where(which == j, a, row))
        sensor = None if data.sensor is None else index[row]
        other = replace(data, sensor=sensor, marker=data.marker[row])
        if data.absolute:
            moved = data.rigid(model) - other.rigid(model)
            whole = data.deflection.copy()
            whole[:, : moved.shape[1]] += moved
            other = replace(other, deflection=whole)
        names = tuple(_marker_name(study, data, index, one) for one in (a, b))
        yield Reading(Finding(Kind.SWAPPED_MARKERS, columns=names), other)


def _marker_name(study: Study, data: Measurements, index: Indices, row: int) -> str:
    """The marker of a row, by its name or its place on the tool."""
    name = study.model.instruments[index[row]].name
    place = ", ".join(f"{1e3 * x:g}" for x in data.marker[row])
    return name or f"({place}) mm"


def _other_axes(data: Measurements) -> Iterator[Reading]:
    """Displacements and rotations are those of a frame with the axes permuted or reversed.

    First come the 23 frames that are turned, then the mirrored ones, as of a left-handed tracker.
    """
    moved = data.deflection
    rotations = moved.shape[1] == 6
    for T in _frames():
        handed = round(float(np.linalg.det(T)))
        # Without rotations these are readings from above: the wrong sign, and exchanged columns.
        if not rotations and handed < 0 and (np.trace(T) == -3 or (T >= 0).all()):
            continue
        parts = [moved[:, :3] @ T.T]
        if rotations:
            # Rotation vectors are axial: a left-handed frame reverses them.
            parts.append(handed * moved[:, 3:] @ T.T)
        expected = tuple(
            f"{'-' * bool(row.sum() < 0)}{DEFLECTION_COLUMNS[int(np.abs(row).argmax())]}"
            for row in T
        )
        named = {"expected": expected, "turn": _turn(T)}
        finding = Finding(Kind.OTHER_AXES, columns=DEFLECTION_COLUMNS, data=named)
        yield Reading(finding, replace(data, deflection=np.hstack(parts)))


def _frames() -> list[Array]:
    """Permutations of the axes with signs (3, 3), the rotations first, without the identity."""
    frames = [
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order, signs in product(permutations(range(3)), product((1, -1), repeat=3))
    ]
    return sorted(frames[1:], key=lambda T: -np.linalg.det(T))


def _turn(T: Array) -> str:
    """A rotation or reflection (3, 3) of the axes, in words."""
    if np.linalg.det(T) < 0:
        return "left-handed"
    angle = round(float(np.rad2deg(np.arccos(np.clip((np.trace(T) - 1) / 2, -1.0, 1.0)))))
    # Of a rotation by 180 degrees about a, T + I is 2 a a'; of others T + T' + ... is along a too.
    fixed = T + T.T + (1 - np.trace(T)) * np.eye(3)
    row = fixed[int(np.abs(np.diag(fixed)).argmax())]
    along = [f"{'-' * bool(a < 0)}{axis}" for a, axis in zip(row, AXES, strict=True) if a]
    about = along[0] if len(along) == 1 else "a diagonal"
    return f"turned by {angle} degrees about {about}"


def _free(study: Study) -> list[int]:
    """The joints that the file must have."""
    return [j for j in range(study.robot.n) if j not in study.fixed]


def _swapped(columns: Sequence[str], i: int, j: int, positions: str = "") -> Finding:
    """Two columns that were exchanged, or the positions along two axes."""
    pair = (columns[i], columns[j])
    return Finding(Kind.SWAPPED_COLUMNS, columns=pair, data={"positions": positions})


def _exchanged(x: Array, i: int, j: int) -> Array:
    """The same with two columns exchanged."""
    other = x.copy()
    other[:, [i, j]] = x[:, [j, i]]
    return other
