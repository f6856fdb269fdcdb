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
from edtk.system.typing import Array, Indices

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
# Of the zero of a joint: a mark that was not met, a mastering by another convention [rad, m].
USUAL_ZERO = {"revolute": np.deg2rad(1.0), "prismatic": 1e-3}
USUAL_LOSS = 0.1  # of a joint's load, which friction holds: gears lose so much
USUAL_LINK = 0.1  # by which links of robots of one family differ [m]
SHORT_LINK = 0.01  # below it two joints count as being in one place [m]
SAME = 1e-6  # share of a fault's squared length that others leave, below which it is rounding


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
    yield frame_rotation(model, data, A)
    yield from _drifts(model, data, A)
    yield from _by_sign(model, data, A)
    yield from _frictions(model, data, A, k)
    yield from _zeros(model, data, A, k)
    yield from _links(model, data)


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


def frame_rotation(model: ElastostaticModel, data: Measurements, A: Array) -> Family:
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
    """Something moves between the unloaded and the loaded reading: always, or more and more.

    What moves more and more has not moved in the first row yet, and has the fault's size in the
    last one: in the mean of all rows, half of it.
    """
    shift = translations(model, data)
    slowly = np.linspace(0, 1, len(A))[:, None, None] * shift

    def step(c: Array) -> tuple[Array, Array]:
        return A, shift @ c

    def growing(c: Array) -> tuple[Array, Array]:
        return A, slowly @ c

    yield Family("drift", "mm", MM, 3, USUAL_DRIFT, step, DRIFTS_ALIKE)
    yield Family("drift", "mm", MM, 3, 2 * USUAL_DRIFT, growing, DRIFTS_GROWING, grows=True)


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


def _frictions(
    model: ElastostaticModel, data: Measurements, A: Array, k: Array
) -> Iterator[Family]:
    """A joint, or every one, that friction holds: a part of its load does not reach the spring.

    Of the load tau the spring sees ``max(|tau| - f, 0)``, so that column j of the regressor is
    ``A_j max(1 - f / |tau_j|, 0)``. Of all joints alike it is the load f that is the same, or the
    angle ``k_j f_j``, as stiffer gears are larger and have more friction.
    """
    torque = np.abs(_torque(model, data))
    kinds = [model.robot.joints[index].kind for index in model.joints]
    loaded = torque.max(axis=0) > 0
    units = {"revolute": ("N m", 1.0), "prismatic": ("N", 1.0)}
    tries = 2 * int(loaded.sum())  # all joints are as likely as a single one
    for j in np.flatnonzero(loaded):
        usual = USUAL_LOSS * float(torque[:, j].mean())
        held = _held(A, torque, np.eye(model.p)[j])
        name = model.robot.joint_names[model.joints[j]]
        yield Family("friction", *units[kinds[j]], 1, usual, held, tries, name, only_positive=True)
    if len(set(kinds)) > 1 or not loaded.any():
        return
    usual = USUAL_LOSS * float(torque.mean())
    held = _held(A, torque, np.ones(model.p))
    yield Family("friction", *units[kinds[0]], 1, usual, held, 4, only_positive=True)
    if (k > 0).all():
        scale = ("deg", DEGREES) if kinds[0] == "revolute" else ("mm", MM)
        held = _held(A, torque, 1 / k)
        usual = USUAL_PLAY[kinds[0]]
        yield Family("friction", *scale, 1, usual, held, 4, only_positive=True)


def _zeros(model: ElastostaticModel, data: Measurements, A: Array, k: Array) -> Iterator[Family]:
    """A joint is counted from a zero that is off; of all joints one.

    Where that does what a turned measuring frame does, as of a vertical axis at the base under a
    vertical load, it is that fault, about this axis.
    """
    robot = model.robot
    turned = frame_rotation(model, data, A).derivative_at_zero(k)
    for j, joint in enumerate(robot.joints):
        name = joint.name
        scale = ("deg", DEGREES) if joint.kind == "revolute" else ("mm", MM)
        predict = _counted_from(model, data, j)
        usual = USUAL_ZERO[joint.kind]
        family = Family("joint_zero", *scale, 1, usual, predict, robot.n, name)
        if _is_one_of(turned, family.derivative_at_zero(k)):
            family = replace(family, cause="frame_rotation", tries=1, usual=USUAL_TURN)
        yield family


def _links(model: ElastostaticModel, data: Measurements) -> Iterator[Family]:
    """A link is longer or shorter than in the model, or all are by the same length."""
    robot = model.robot
    length = np.array([np.linalg.norm(joint.origin[:3, 3]) for joint in robot.joints])
    long = np.flatnonzero(length > SHORT_LINK)
    if not data.absolute:
        long = long[long > 0]  # where the first joint is, no displacement shows
    # One link, which the joint at its end names, or all of them.
    single = [(np.array([j]), robot.joint_names[j]) for j in long]
    for chosen, name in [*single, (long, "")] if single else []:
        tries = 2 * len(long) if name else 2
        predict = _longer(model, data, chosen, length)
        yield Family("link_length", "mm", MM, 1, USUAL_LINK, predict, tries, name)


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


def _held(A: Array, torque: Array, share: Array) -> Callable[[Array], tuple[Array, Array]]:
    """Joints that lose the shares (p,) of a load, of their loads (m, p) without sign."""
    lost = np.divide(share, torque, out=np.zeros_like(torque), where=torque > 0)[:, None]
    return lambda c: (A * np.maximum(1 - c[0] * lost, 0.0), np.zeros(A.shape[:2]))


def _counted_from(
    model: ElastostaticModel, data: Measurements, j: int
) -> Callable[[Array], tuple[Array, Array]]:
    """Poses in which joint j is further than written."""

    def predict(c: Array) -> tuple[Array, Array]:
        shown = model.robot.shown(data.q).copy()
        shown[:, j] += c[0]
        other = replace(data, q=model.robot.of_shown(shown))
        return other.regressor(model), _shift(data, other.rigid(model) - data.rigid(model))

    return predict


def _longer(
    model: ElastostaticModel, data: Measurements, chosen: Indices, length: Array
) -> Callable[[Array], tuple[Array, Array]]:
    """A robot with links that are longer, all by the same."""

    def predict(c: Array) -> tuple[Array, Array]:
        joints = list(model.robot.joints)
        for j in chosen:
            origin = joints[j].origin.copy()
            origin[:3, 3] *= 1 + c[0] / length[j]
            joints[j] = replace(joints[j], origin=origin)
        other = replace(model, robot=replace(model.robot, joints=tuple(joints)))
        return data.regressor(other), _shift(data, data.rigid(other) - data.rigid(model))

    return predict


def _shift(data: Measurements, moved: Array) -> Array:
    """What readings (m, rows) show of a motion of the rigid robot (m, c): nothing, or all."""
    found = np.zeros(data.deflection.shape)
    if data.absolute:
        found[:, : moved.shape[1]] = moved
    return found


def _is_one_of(columns: Array, column: Array) -> bool:
    """Whether some changes (m, rows, c) of the measurements can make another one (m, rows, 1)."""
    other = column.ravel()
    made = columns.reshape(len(other), -1)
    left = other - made @ np.linalg.lstsq(made, other, rcond=None)[0]
    return bool(left @ left < SAME * (other @ other))


def _turned(turn: Array, vectors: Array) -> Array:
    """Vectors (..., 3) turned by a rotation vector (3,) [rad]."""
    from scipy.spatial.transform import Rotation

    return vectors @ Rotation.from_rotvec(turn).as_matrix().T
