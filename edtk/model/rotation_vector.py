"""Rotations as vectors along their axis, of the length of their angle."""

import numpy as np

from edtk.system.typing import Array

# Rotation angle [rad] below which the closed form of the inverse Jacobian cancels, and two terms of
# its series are exact to the last digit.
SMALL = 1e-2


def rotation_vector(R: Array) -> Array:
    """Rotation vectors (3, ...) of rotations (3, 3, ...) [rad]."""
    # Imported here, as it takes 0.2 s, and commands without an equilibrium do not need it.
    from scipy.spatial.transform import Rotation

    batch = R.shape[2:]
    matrices = np.moveaxis(R, (0, 1), (-2, -1)).reshape(-1, 3, 3)
    found = Rotation.from_matrix(matrices).as_rotvec() if len(matrices) else np.zeros((0, 3))
    return np.moveaxis(found.reshape(*batch, 3), -1, 0)


def inverse_left_jacobian(r: Array) -> Array:
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
