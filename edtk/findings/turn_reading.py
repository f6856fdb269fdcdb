"""Orientations that are written in another way than a sheet should have them."""

from collections.abc import Callable, Mapping

import numpy as np

from edtk.findings.counting import SEARCH
from edtk.findings.gross_errors import DEGREE
from edtk.fit.marker_positions import MarkerPositions, turn_columns
from edtk.measure.pose_table import PoseTable, Table, pose_columns
from edtk.robots.robot import Robot
from edtk.system.typing import Array

MOST_VISITS = 60  # that are compared, each with all others
LARGE_DIFFERENCE = 0.1  # of the angles themselves
BASE_TURNS = 4  # of finding the base, and of choosing the pairs that fit it
KEPT_PAIRS = 0.5  # of the pairs
LEAST_VISITS = 3  # visits, of which each two are compared
EXPECTED = (
    "degrees everywhere, and rotation vectors (axis times angle) or quaternions with qw first"
)
INVERSE = "those of the instrument, seen from the marker"
FAR_TURNED = DEGREE  # no drawing turns a tool as wrongly

Reading = Callable[[Array], Array]


def turn_reading(path: Table, robot: Robot, data: MarkerPositions) -> str:
    """Tell how orientations, or joint angles beside them, are written where that is not as said.

    Orientations ``R_i = B F_i T`` of a marker in two visits, with the base B, the flange F_i of the
    drawing and the place T on the tool, differ by the rotation ``R_i R_j' = B (F_i F_j') B'``: by
    the same angle as those of the flange, about an axis that B has turned. So the B that fits best,
    and the median of what is left over all pairs of visits, tell which way to read the numbers
    fits; a few wrong rows do no harm. Numbers that are all too small, by radians everywhere, differ
    by little; so differences count beside the angles themselves, too.

    Args:
        path: The sheet.
        robot: The drawing.
        data: What was read of the sheet.

    Returns:
        The way that fits, in words; empty where what was said fits, or nothing does.
    """
    if data.turns is None:
        return ""
    for marker in range(len(data.markers)):
        seen = np.flatnonzero(np.isfinite(data.turns[:, marker]).all(axis=(1, 2)))
        if len(seen) >= LEAST_VISITS:
            some = seen[np.linspace(0, len(seen) - 1, min(len(seen), MOST_VISITS)).astype(int)]
            words = _of_marker(path, robot, data, marker, np.unique(some))
            if words:
                return words
    return ""


def _of_marker(path: Table, robot: Robot, data: MarkerPositions, marker: int, visits: Array) -> str:
    """The same of one marker in some visits."""
    assert data.turns is not None
    joints = _ways_of_joints(robot, data.q[visits])
    said, share = _apart(data.turns[visits, marker], joints[""])
    if said < FAR_TURNED and share < LARGE_DIFFERENCE:
        return ""
    name = data.markers[marker]
    values = _written(path, robot, name, data.row[visits, marker])
    readings = VECTORS if values.shape[1] == 3 else QUATERNIONS
    found = [
        (*_apart(read(values), flange), turned, counted)
        for turned, read in readings.items()
        for counted, flange in joints.items()
    ]
    fitting = [
        one
        for one in found
        if one[0] < FAR_TURNED and one[1] < min(LARGE_DIFFERENCE, share / SEARCH.much_better)
    ]
    if not fitting:
        return ""
    least = min(one[1] for one in fitting)
    # Quaternions in another order are, but for base and tool, those of the inverse.
    _, _, turned, counted = next(one for one in fitting if one[1] <= SEARCH.alike * least)
    parts = [f"joint angles are taken as {counted}"] * bool(counted)
    parts += [f"orientations of {name} are taken as {turned}"] * bool(turned)
    return " and ".join(parts)


def _apart(turns: Array, flange: Array) -> tuple[float, float]:
    """How far orientations (m, 3, 3) are from those of the flange, by any base and any place on it.

    Returns:
        The median difference [rad] over pairs of visits, and its share of the turns between them.
    """
    i, j = np.triu_indices(len(turns), 1)
    own, drawn = (one[i] @ np.swapaxes(one[j], 1, 2) for one in (turns, flange))
    axes = [_skew_part(one) for one in (own, drawn)]
    angles = [
        np.arccos(np.clip((np.trace(one, axis1=1, axis2=2) - 1) / 2, -1, 1)) for one in (own, drawn)
    ]
    chosen = np.arange(len(i))
    for _ in range(BASE_TURNS):
        U, _, Vt = np.linalg.svd(axes[0][chosen].T @ axes[1][chosen])
        base = (U * np.array([1.0, 1.0, np.linalg.det(U @ Vt)])) @ Vt
        left = np.linalg.norm(axes[0] - axes[1] @ base.T, axis=1) + np.abs(angles[0] - angles[1])
        chosen = np.argsort(left, kind="stable")[: int(np.ceil(KEPT_PAIRS * len(i)))]
    apart = float(np.median(left))
    usual = float(np.median(angles[1]))
    return apart, apart / usual if usual > 0 else np.inf


def _skew_part(turns: Array) -> Array:
    """Axes (m, 3) of rotations (m, 3, 3), as long as the sines of their angles."""
    apart = turns - np.swapaxes(turns, 1, 2)
    return 0.5 * np.stack([apart[:, 2, 1], apart[:, 0, 2], apart[:, 1, 0]], axis=1)


def _ways_of_joints(robot: Robot, q: Array) -> Mapping[str, Array]:
    """Orientations (m, 3, 3) of the flange with joint angles as read, and as if in radians."""
    ways = {"": q, "radians": np.where(robot.slides, q, q / DEGREE)}
    return {words: robot.forward(way)[:, :3, :3] for words, way in ways.items()}


def _written(path: Table, robot: Robot, name: str, rows: Array) -> Array:
    """The numbers (m, 3) or (m, 4) of an orientation in some rows of the sheet."""
    table = PoseTable.read(path, "sheet")
    columns = turn_columns(table, [name], pose_columns(robot))[name]
    chosen = np.zeros(len(table), dtype=bool)
    chosen[rows] = True
    return np.asarray(table.of_rows(chosen).vectors(columns)[rows])


def _vector(unit: float) -> Reading:
    """Of rotation vectors in some unit [rad]."""

    def read(values: Array) -> Array:
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_rotvec(unit * values).as_matrix())

    return read


def _angles_about(axes: str, unit: float) -> Reading:
    """Of three angles about axes, capital ones moving, in some unit [rad]."""

    def read(values: Array) -> Array:
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_euler(axes, unit * values).as_matrix())

    return read


def _quaternion(roll: int) -> Reading:
    """Of quaternions, whose numbers are moved by so many places to have the scalar last."""

    def read(values: Array) -> Array:
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_quat(np.roll(values, roll, axis=1)).as_matrix())

    return read


def _inverse(reading: Reading) -> Reading:
    """Of the inverse of what another reading reads."""
    return lambda values: np.swapaxes(reading(values), 1, 2)


# In order of trust: of two that fit alike the first is meant.
VECTORS: dict[str, Reading] = {
    "": _vector(DEGREE),
    "rotation vectors in radians": _vector(1.0),
    "rotation vectors that were multiplied by 57.3 once too often": _vector(DEGREE**2),
    "angles about fixed axes x, y, z (roll, pitch, yaw) in degrees": _angles_about("xyz", DEGREE),
    "angles about fixed axes x, y, z (roll, pitch, yaw) in radians": _angles_about("xyz", 1.0),
    "angles about moving axes x, y, z in degrees": _angles_about("XYZ", DEGREE),
    "angles about moving axes x, y, z in radians": _angles_about("XYZ", 1.0),
    INVERSE: _inverse(_vector(DEGREE)),
}
QUATERNIONS: dict[str, Reading] = {
    "": _quaternion(-1),
    "quaternions with the scalar last": _quaternion(0),
    INVERSE: _inverse(_quaternion(-1)),
}
