"""The faults that are tried where residuals are too large, each of any size."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from edtk.calibration.causes.family import Family
from edtk.inference.measurements import Measurements
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array

MM = 1e3
DEGREES = 180 / np.pi
PERCENT = 100.0
AXES = "xyz"


def families(model: ElastostaticModel, data: Measurements, k: Array) -> Iterator[Family]:
    """List faults of the whole experiment; those of single poses are another matter.

    Args:
        model: The robot with its calibration tool, and the measured rows.
        data: The measurements.
        k: Fitted compliances (p,) [rad/(N m)].
    """
    A = data.regressor(model)
    yield _load_direction(model, data)
    yield from _tool(model, data)
    yield _frame(A, k)
    yield from _drifts(A)
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

    return Family("load_direction", "deg", DEGREES, len(turns), predict)


def _tool(model: ElastostaticModel, data: Measurements) -> Iterator[Family]:
    """The tool point is elsewhere, along one axis of the tool."""
    for i in range(3):

        def predict(c: Array, axis: int = i) -> tuple[Array, Array]:
            tool = model.robot.tool.copy()
            tool[:3, 3] += c[0] * tool[:3, axis]
            other = replace(model, robot=model.robot.with_tool(tool))
            return data.regressor(other), np.zeros(data.deflection.shape)

        yield Family(f"tool_{AXES[i]}", "mm", MM, 1, predict)


def _frame(A: Array, k: Array) -> Family:
    """The measuring frame is turned about the world's axes."""

    def predict(c: Array) -> tuple[Array, Array]:
        turned = np.empty_like(A)
        for first in range(0, A.shape[1], 3):
            part = A[:, first : first + 3]
            turned[:, first : first + 3] = np.moveaxis(_turned(c, np.moveaxis(part, 1, -1)), -1, 1)
        return turned, np.zeros(A.shape[:2])

    return Family("frame_rotation", "deg", DEGREES, 3, predict)


def _drifts(A: Array) -> Iterator[Family]:
    """Something moves between the unloaded and the loaded reading: always, or more and more."""
    m, rows = A.shape[:2]
    for growth in (np.ones(m), np.linspace(-1, 1, m)):
        moved = np.zeros((m, rows, 3))
        moved[:, :3] = growth[:, None, None] * np.eye(3)

        def predict(c: Array, moved: Array = moved) -> tuple[Array, Array]:
            return A, moved @ c

        yield Family("drift", "mm", MM, 3, predict, tries=2)


def _by_sign(model: ElastostaticModel, data: Measurements, A: Array) -> Iterator[Family]:
    """A joint whose compliance, or position, depends on the sign of its load."""
    whole = ElastostaticModel(model.robot, model.unknown, "pose")
    J = np.swapaxes(model.robot.jacobian(data.q)[..., model.joints], 1, 2)
    sign = np.sign((J @ data.wrench[..., None])[..., 0])
    # The motion of the marker by a unit of each joint, from the motion by a unit of its torque.
    torque = (J @ data.wrench[..., None])[..., 0]
    unit = np.divide(A, torque[:, None], out=np.zeros_like(A), where=torque[:, None] != 0)
    for j, index in enumerate(whole.joints):
        name = model.robot.joint_names[index]
        if not (sign[:, j] > 0).any() or not (sign[:, j] < 0).any():
            continue

        def stiffer(c: Array, j: int = j) -> tuple[Array, Array]:
            other = A.copy()
            other[..., j] *= 1 + c[0] * sign[:, j][:, None]
            return other, np.zeros(A.shape[:2])

        def loose(c: Array, j: int = j) -> tuple[Array, Array]:
            return A, c[0] * unit[..., j] * sign[:, j][:, None]

        revolute = model.robot.joints[index].kind == "revolute"
        size = ("deg", DEGREES) if revolute else ("mm", MM)
        yield Family("torque_sign", "%", PERCENT, 1, stiffer, tries=model.p, joint=name)
        yield Family("backlash", *size, 1, loose, tries=model.p, joint=name)


def _turned(turn: Array, vectors: Array) -> Array:
    """Vectors (..., 3) turned by a rotation vector (3,) [rad]."""
    from scipy.spatial.transform import Rotation

    return vectors @ Rotation.from_rotvec(turn).as_matrix().T
