"""The faults that are tried where residuals are too large, each of any size."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from edtk.calibration.causes.family import Family
from edtk.calibration.whole_rows import whole_rows
from edtk.inference.measured_points import measured_points
from edtk.inference.measurements import Measurements
from edtk.inference.translations import translations
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array

MM = 1e3
DEGREES = 180 / np.pi
PERCENT = 100.0
AXES = "xyz"

# Sizes that faults usually have, within a factor of a few.
USUAL_TILT = np.deg2rad(3.0)  # of a load that hangs or pushes askew
USUAL_TURN = np.deg2rad(2.0)  # of a frame that was not aligned
# Errors of a tool point that was measured by hand: flanges centre tools, whose lengths differ [m].
USUAL_TOOL = (2e-3, 2e-3, 10e-3)
USUAL_DRIFT = 0.05e-3  # motion of a tracker or a foundation within a few minutes [m]
# Three of four drifts are a step that all readings share; the others grow from reading to reading.
DRIFTS_ALIKE = 4 / 3
DRIFTS_GROWING = 4.0
USUAL_SHARE = 0.15  # of a compliance, by which the sign of its torque changes it to either side
# To a side: robots' gears have a lost motion of about one arc-minute in all [rad, m].
USUAL_PLAY = {"revolute": np.deg2rad(1 / 120), "prismatic": 0.05e-3}


def families(model: ElastostaticModel, data: Measurements, A: Array, k: Array) -> Iterator[Family]:
    """List faults of the whole experiment; those of single poses are another matter.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: The measurements.
        A: Their regressors (m, rows, p) in this model.
        k: Fitted compliances (p,) [rad/(N m)].
    """
    yield _load_direction(model, data)
    yield from _tool(model, data)
    yield _frame(model, data, A)
    yield from _drifts(model, data, A)
    yield from _by_sign(model, data, A)


def _load_direction(model: ElastostaticModel, data: Measurements) -> Family:
    """The load is turned about the world's axes that are not its own."""
    mean = data.wrench[:, :3].mean(axis=0)
    turns = np.linalg.svd(mean[None])[2][1:] if mean.any() else np.eye(3)

    def predict(c: Array) -> tuple[Array, Array]:
        turn = c @ turns
        wrench = data.wrench.copy()
        wrench[:, :3] = _turned(turn, wrench[:, :3])
        wrench[:, 3:] = _turned(turn, wrench[:, 3:])
        return replace(data, wrench=wrench).regressor(model), np.zeros(data.deflection.shape)

    return Family("load_direction", "deg", DEGREES, len(turns), USUAL_TILT, predict)


def _tool(model: ElastostaticModel, data: Measurements) -> Iterator[Family]:
    """The tool point is elsewhere, along one axis of the tool.

    Positions that are counted from the rigid robot see that at once.
    """
    shown = _shown_by_tool(model, data) if data.absolute else np.zeros((*data.deflection.shape, 3))
    for i in range(3):

        def predict(c: Array, axis: int = i) -> tuple[Array, Array]:
            tool = model.robot.tool.copy()
            tool[:3, 3] += c[0] * tool[:3, axis]
            other = replace(model, robot=replace(model.robot, tool=tool))
            return data.regressor(other), c[0] * shown[..., axis]

        yield Family(f"tool_{AXES[i]}", "mm", MM, 1, USUAL_TOOL[i], predict)


def _shown_by_tool(model: ElastostaticModel, data: Measurements) -> Array:
    """By how much readings grow (m, rows, 3) where the tool point moves along the tool's axes."""
    axes = np.moveaxis(model.frames(data.q).rotation, -1, 0)  # (m, axis of the tool, 3)
    found = np.einsum("mrc,mac->mra", translations(model, data), axes)
    for rows, sensor in data.instruments(model):
        if sensor.point.joint is not None:
            found[rows] = 0.0
    return found


def _frame(model: ElastostaticModel, data: Measurements, A: Array) -> Family:
    """The measuring frame is turned about the world's axes.

    So are displacements and rotations; and positions, where they are counted from the rigid robot.
    Distances do not see it.
    """
    whole, own = whole_rows(model, data, A)
    m, rows = A.shape[:2]
    places = (
        measured_points(model, data)[:, None, :, None] if data.absolute else np.zeros((m, 1, 3, 1))
    )

    def predict(c: Array) -> tuple[Array, Array]:
        turned = np.moveaxis(_turned(c, np.moveaxis(whole, 2, -1)), -1, 2)
        moved = np.moveaxis(_turned(c, np.moveaxis(places, 2, -1)), -1, 2) - places
        offset = np.zeros((m, rows))
        if own is None:
            offset[:, :3] = moved[:, 0, :, 0]
            return turned.reshape(A.shape), offset
        seen = np.flatnonzero(own >= 0)
        found = A.copy()
        found[seen, 0] = turned[seen, 0, own[seen]]
        lengths = seen[data.lengths[seen, 0]]
        offset[lengths, 0] = moved[lengths, 0, own[lengths], 0]
        return found, offset

    return Family("frame_rotation", "deg", DEGREES, 3, USUAL_TURN, predict)


def _drifts(model: ElastostaticModel, data: Measurements, A: Array) -> Iterator[Family]:
    """Something moves between the unloaded and the loaded reading: always, or more and more."""
    m = len(A)
    shift = translations(model, data)
    for growth, tries in ((np.ones(m), DRIFTS_ALIKE), (np.linspace(-1, 1, m), DRIFTS_GROWING)):
        moved = growth[:, None, None] * shift

        def predict(c: Array, moved: Array = moved) -> tuple[Array, Array]:
            return A, moved @ c

        yield Family("drift", "mm", MM, 3, USUAL_DRIFT, predict, tries)


def _by_sign(model: ElastostaticModel, data: Measurements, A: Array) -> Iterator[Family]:
    """A joint, or every one, whose compliance or position depends on the sign of its load."""
    torque = _torque(model, data)
    sign = np.sign(torque)[:, None]  # (m, 1, p)
    # The motion of the marker by a unit of each joint, from the motion by a unit of its torque.
    unit = np.divide(A, torque[:, None], out=np.zeros_like(A), where=torque[:, None] != 0)
    names = [model.robot.joint_names[index] for index in model.joints]
    kinds_of = [model.robot.joints[index].kind for index in model.joints]
    both = (torque > 0).any(axis=0) & (torque < 0).any(axis=0)
    every = np.ones(model.p, dtype=bool)
    # One joint that has torques of both signs, or all joints alike: arms are built of equal gears.
    single = [(every & (np.arange(model.p) == j), names[j]) for j in np.flatnonzero(both)]
    for chosen, name in [*single, (every, "")] if both.any() else single:
        tries = 2 * len(single) if name else 2  # all joints are as likely as a single one
        predict = _stiffer(A, sign * chosen)
        yield Family("torque_sign", "%", PERCENT, 1, USUAL_SHARE, predict, tries, name)
        kinds = {kind for kind, one in zip(kinds_of, chosen, strict=True) if one}
        if len(kinds) == 1:  # the sizes of turning and of sliding joints are no one number
            kind = kinds.pop()
            scale = ("deg", DEGREES) if kind == "revolute" else ("mm", MM)
            predict = _loose(A, (unit * sign * chosen).sum(axis=-1))
            usual = USUAL_PLAY[kind]
            yield Family("backlash", *scale, 1, usual, predict, tries, name, only_positive=True)


def _torque(model: ElastostaticModel, data: Measurements) -> Array:
    """Loads (m, p) of the unknown joints [N m, or N if prismatic]."""
    if not model.is_plain:
        return model.torque_of(model.frames(data.q), data.wrench)[model.joints].T
    J = np.swapaxes(model.robot.jacobian(data.q)[..., model.joints], 1, 2)
    return np.asarray((J @ data.wrench[..., None])[..., 0])


def _stiffer(A: Array, sign: Array) -> Callable[[Array], tuple[Array, Array]]:
    """Compliances that are larger by a share where the sign (m, 1, p) is positive."""
    return lambda c: (A * (1 + c[0] * sign), np.zeros(A.shape[:2]))


def _loose(A: Array, moved: Array) -> Callable[[Array], tuple[Array, Array]]:
    """Joints that give way by an angle, which moves markers by (m, rows) a unit."""
    return lambda c: (A, c[0] * moved)


def _turned(turn: Array, vectors: Array) -> Array:
    """Vectors (..., 3) turned by a rotation vector (3,) [rad]."""
    from scipy.spatial.transform import Rotation

    return vectors @ Rotation.from_rotvec(turn).as_matrix().T
