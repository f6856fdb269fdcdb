"""Rotations as vectors along their axis, of the length of their angle."""

import numpy as np

from edtk.system.typing import Array

# Rotation angle [rad] below which the closed form of the inverse Jacobian cancels, and two terms of
# its series are exact to the last digit.
SMALL = 1e-2


def rotation_vector(R: Array) -> Array:
    """Rotation vectors (3, ...) of rotations (3, 3, ...) [rad].

    By way of the quaternion, of which the largest component is found first, so that nothing is
    divided by a small one (Shepperd, J. Guidance and Control 1, 1978). Written out, as scipy's
    takes longer to import than many a command to do its work.
    """
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    turn = [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]
    xy = R[0, 1] + R[1, 0]
    xz = R[0, 2] + R[2, 0]
    yz = R[1, 2] + R[2, 1]
    x, y, z = (1.0 + 2.0 * R[k, k] - trace for k in range(3))
    # Each row is the quaternion times four of its components in turn.
    rows = np.array(
        [[1.0 + trace, *turn], [turn[0], x, xy, xz], [turn[1], xy, y, yz], [turn[2], xz, yz, z]]
    )
    largest = np.argmax([rows[k, k] for k in range(4)], axis=0)
    q = np.take_along_axis(rows, largest[None, None], axis=0)[0]
    q = q / np.linalg.norm(q, axis=0)
    q = np.where(q[0] < 0, -q, q)
    size = np.linalg.norm(q[1:], axis=0)
    small = size < SMALL
    series = 2.0 + size**2 / 3.0 + 3.0 * size**4 / 20.0 + 5.0 * size**6 / 56.0
    closed = 2.0 * np.arctan2(size, q[0]) / np.where(small, 1.0, size)
    return np.asarray(q[1:] * np.where(small, series, closed))


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
