"""The loaded equilibrium as a model that is linear in the compliances, about given ones."""

from dataclasses import dataclass

import numpy as np

from edtk.inference.equilibrium_deflection import marker_motion
from edtk.inference.measurements import Measurements
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.equilibrium import equilibrium, torque_and_derivative
from edtk.system.typing import Array

# Rotation angle [rad] below which the closed form of the inverse Jacobian cancels, and two terms of
# its series are exact to the last digit.
SMALL = 1e-2
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
    rest = equilibrium(model.robot, q, wrench, k, signed=True)
    deflection = marker_motion(model, data.q, rest.displacement[data.pose], data.marker)
    turned = _joint_derivative(model, q + rest.theta, wrench, k)
    A = _marker_derivative(model, data, q + rest.theta, turned)
    if model.rows == "pose":
        A[:, 3:] = _inverse_left_jacobian(rest.displacement[data.pose, 3:]) @ A[:, 3:]
    return Linearisation(A, deflection - A @ k[model.joints])


def _joint_derivative(model: ElastostaticModel, q: Array, wrench: Array, k: Array) -> Array:
    """``dtheta/dk`` (N, n, p) in loaded poses q (N, n)."""
    tau, H = torque_and_derivative(model.robot, q, wrench)
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


def _inverse_left_jacobian(r: Array) -> Array:
    """``J_l(r)^-1 = I - [r]x / 2 + c [r]x^2`` (m, 3, 3) of rotation vectors r (m, 3) [rad].

    ``c = 1/a^2 - (1 + cos a) / (2 a sin a)`` for the angle a; ``1/12 + a^2/720 + ...`` near zero.
    """
    angle = np.linalg.norm(r, axis=-1)
    safe = np.where(angle < SMALL, 1.0, angle)
    closed = 1 / safe**2 - (1 + np.cos(safe)) / (2 * safe * np.sin(safe))
    series = 1 / 12 + angle**2 / 720 + angle**4 / 30240
    c = np.where(angle < SMALL, series, closed)
    X = np.zeros((len(r), 3, 3))
    X[:, 0, 1] = -r[:, 2]
    X[:, 0, 2] = r[:, 1]
    X[:, 1, 2] = -r[:, 0]
    X = X - np.swapaxes(X, 1, 2)
    return np.eye(3) - X / 2 + c[:, None, None] * (X @ X)
