"""The loaded equilibrium as a model that is linear in the compliances, about given ones."""

from dataclasses import dataclass

import numpy as np

from edtk.inference.equilibrium_deflection import marker_motion
from edtk.inference.measurements import Measurements
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.equilibrium import AT_TOOL_POINT, equilibrium, torque_and_derivative
from edtk.model.loading import Loading
from edtk.model.rest import Rest
from edtk.model.rotation_vector import inverse_left_jacobian
from edtk.system.typing import Array

BLOCK = 4096  # measurements at once; of 1e5, twice as fast as all of them at once


@dataclass(frozen=True, eq=False)
class Linearisation:
    """``deflection(k) = constant + A k`` to the first order in k.

    Attributes:
        A: Derivatives (m, rows, p) of the deflections by the unknown compliances
            [m/(rad/(N m))].
        constant: Deflections (m, rows) less ``A k``, at the compliances of the linearisation
            [m, rad].
    """

    A: Array
    constant: Array


def linearise(model: ElastostaticModel, data: Measurements, k: Array) -> Linearisation:
    """Differentiate the deflections of a robot at rest under load by its compliances.

    The rest ``theta = diag(k) tau(q + theta)`` moves with compliance j by

        (I - diag(k) H) dtheta/dk_j = tau_j e_j,    H = dtau/dtheta,

    and a marker by its Jacobian in the loaded pose times that. A rotation vector r of the tool
    changes by ``J_l(r)^-1 w`` where the tool turns by w, with the left Jacobian of SO(3).

    At k = 0 this is the linear model, Eq. (4), with a constant of zero.

    Args:
        model: The robot with its calibration tool, the unknown joints, and the measured rows.
        data: Poses, loads and markers; measured values are not used.
        k: Compliances (n,) of all joints [rad/(N m)]. An estimate of a small one may be negative.

    Raises:
        NoEquilibriumError: A pose buckles under its load.
    """
    # Rows of one pose, such as its repetitions and its markers, share the equilibrium.
    if len(data) > BLOCK:
        # The arrays of very many poses would not fit into a core's cache, nor into a small memory.
        parts = [linearise(model, data[i : i + BLOCK], k) for i in range(0, len(data), BLOCK)]
        A = np.concatenate([part.A for part in parts])
        return Linearisation(A, np.concatenate([part.constant for part in parts]))
    first = np.unique(data.pose, return_index=True)[1]
    q = data.q[first]
    wrench = data.wrench[first]
    if data.sensor is not None or not model.is_plain or model.own_weights is not None:
        return _of_sensors(model, data, k, Rest.of(model, q, wrench, k, signed=True), wrench)
    rest = equilibrium(model.robot, q, wrench, k, signed=True)
    deflection = marker_motion(model, data.q, rest.displacement[data.pose], data.marker)
    turned = _joint_derivative(model, q + rest.theta, wrench, k, AT_TOOL_POINT)
    A = _marker_derivative(model, data, q + rest.theta, turned)
    if model.rows == "pose":
        A[:, 3:] = inverse_left_jacobian(rest.displacement[data.pose, 3:]) @ A[:, 3:]
    return Linearisation(A, deflection - A @ k[model.joints])


def _of_sensors(
    model: ElastostaticModel, data: Measurements, k: Array, rest: Rest, wrench: Array
) -> Linearisation:
    """The same for any instruments and weights, of a robot that is at rest in each pose."""
    end = np.moveaxis(_joint_derivative(model, rest.end, wrench, k, model.loading), 0, -1)
    start = np.zeros_like(end)
    if model.own_weights is not None:
        none = np.zeros_like(wrench)
        own = Loading(weights=model.own_weights)
        start = np.moveaxis(_joint_derivative(model, rest.start, none, k, own), 0, -1)
    before = model.frames(rest.start)
    after = model.frames(rest.end)
    A = np.empty((*data.deflection.shape, model.p))
    for rows, sensor in data.instruments(model):
        pose = data.pose[rows]
        poses = (before[pose], after[pose])
        derivative = sensor.change_derivative(*poses, start[..., pose], end[..., pose])
        A[rows] = np.moveaxis(derivative, -1, 0)
    return Linearisation(A, data.changes(model, rest) - A @ k[model.joints])


def _joint_derivative(
    model: ElastostaticModel, q: Array, wrench: Array, k: Array, loading: Loading
) -> Array:
    """``dtheta/dk`` (N, n, p) in loaded poses q (N, n)."""
    tau, H = torque_and_derivative(model.robot, q, wrench, loading)
    stiff = np.eye(model.robot.n) - k[:, None] * H
    loads = np.zeros((*tau.shape, model.p))
    loads[:, model.joints, np.arange(model.p)] = tau[:, model.joints]
    return np.asarray(np.linalg.solve(stiff, loads))


def _marker_derivative(
    model: ElastostaticModel, data: Measurements, q: Array, turned: Array
) -> Array:
    """Derivatives (m, rows, p) of the markers' motions, rotations as angular velocities.

    Args:
        model: The robot and the measured rows.
        data: The markers, and the pose of each row.
        q: Loaded joint variables (N, n) of each distinct pose.
        turned: ``dtheta/dk`` (N, n, p) in these poses.
    """
    frames = model.robot.frames(q)
    linear = np.moveaxis(frames.linear, -1, 0)  # (N, n, 3)
    angular = np.moveaxis(frames.angular, -1, 0)
    moved = np.swapaxes(linear, 1, 2) @ turned  # (N, 3, p)
    rotated = np.swapaxes(angular, 1, 2) @ turned
    moved = moved[data.pose]
    rotated = rotated[data.pose]
    if data.marker.any():
        orientation = np.moveaxis(frames.rotation, -1, 0)[data.pose]  # rows are the tool's axes
        offset = (np.swapaxes(orientation, 1, 2) @ data.marker[..., None])[..., 0]
        moved = moved + np.cross(rotated, offset[..., None], axis=1)
    return np.concatenate([moved, rotated], axis=1) if model.rows == "pose" else moved
