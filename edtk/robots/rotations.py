"""Rotations as vectors and as matrices, homogeneous transforms, and numbers without rounding."""

import numpy as np
from numpy.typing import ArrayLike

from edtk.system.typing import Array

# Rotation angle [rad] below which the closed form of the inverse Jacobian cancels, and two terms of
# its series are exact to the last digit.
SMALL_ANGLE = 1e-2
# Angle [rad] below which closed forms cancel, and two terms of a series are exact.
SMALL_VECTOR = 1e-3
NO_ANGLE = 1e-20  # [rad], whose sine is as large as it


def vector_product(a: Array, b: Array) -> Array:
    """``a x b`` of vectors (..., 3) that broadcast, bit for bit as `np.cross`.

    Of few vectors `np.cross` spends most of its time on the order of axes.
    """
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.subtract(a[..., j] * b[..., k], a[..., k] * b[..., j], out=out[..., i])
    return out


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
    small = size < SMALL_ANGLE
    series = 2.0 + size**2 / 3.0 + 3.0 * size**4 / 20.0 + 5.0 * size**6 / 56.0
    closed = 2.0 * np.arctan2(size, q[0]) / np.where(small, 1.0, size)
    return np.asarray(q[1:] * np.where(small, series, closed))


def inverse_left_jacobian(r: Array) -> Array:
    """``J_l(r)^-1 = I - [r]x / 2 + c [r]x^2`` (m, 3, 3) of rotation vectors r (m, 3) [rad].

    ``c = 1/a^2 - (1 + cos a) / (2 a sin a)`` for the angle a; ``1/12 + a^2/720 + ...`` near zero.
    """
    angle = np.linalg.norm(r, axis=-1)
    safe = np.where(angle < SMALL_ANGLE, 1.0, angle)
    closed = 1 / safe**2 - (1 + np.cos(safe)) / (2 * safe * np.sin(safe))
    series = 1 / 12 + angle**2 / 720 + angle**4 / 30240
    c = np.where(angle < SMALL_ANGLE, series, closed)
    X = np.zeros((len(r), 3, 3))
    X[:, 0, 1] = -r[:, 2]
    X[:, 0, 2] = r[:, 1]
    X[:, 1, 2] = -r[:, 0]
    X = X - np.swapaxes(X, 1, 2)
    return np.eye(3) - X / 2 + c[:, None, None] * (X @ X)


def skew(w: Array) -> Array:
    """Matrices ``[w]x`` (..., 3, 3) with ``[w]x v = w x v``, of vectors w (..., 3)."""
    S = np.zeros((*w.shape, 3))
    S[..., 0, 1] = -w[..., 2]
    S[..., 0, 2] = w[..., 1]
    S[..., 1, 0] = w[..., 2]
    S[..., 1, 2] = -w[..., 0]
    S[..., 2, 0] = -w[..., 1]
    S[..., 2, 1] = w[..., 0]
    return S


def rotation(w: Array) -> Array:
    """Rotations ``exp([w]x)`` (..., 3, 3) by vectors w (..., 3) [rad] (Rodrigues).

    ``I + sin a/a [w]x + (1 - cos a)/a^2 [w]x^2`` for the angle a, written out: densities and fits
    ask for few turns at a time, very often.
    """
    x, y, z = w[..., 0], w[..., 1], w[..., 2]
    xx, yy, zz = x * x, y * y, z * z
    angle = np.sqrt(xx + yy + zz)
    first = _sinc(angle)
    second = 0.5 * _sinc(0.5 * angle) ** 2
    R = np.empty((*w.shape, 3))
    R[..., 0, 0] = 1.0 - second * (yy + zz)
    R[..., 1, 1] = 1.0 - second * (xx + zz)
    R[..., 2, 2] = 1.0 - second * (xx + yy)
    for i, j, both, turn in ((0, 1, x * y, -z), (1, 2, y * z, -x), (2, 0, z * x, -y)):
        even, odd = second * both, first * turn
        R[..., i, j] = even + odd
        R[..., j, i] = even - odd
    return R


def _sinc(angle: Array) -> Array:
    """``sin a / a`` of angles that are not negative; 1 at zero."""
    safe = np.maximum(angle, NO_ANGLE)
    return np.asarray(np.sin(safe) / safe)


def rotation_vectors(R: Array) -> Array:
    """Vectors (..., 3) of rotations (..., 3, 3) [rad], of an angle of at most pi."""
    from scipy.spatial.transform import Rotation

    vectors = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_rotvec()
    return np.asarray(vectors.reshape(R.shape[:-1]))


def left_jacobian(w: Array) -> Array:
    """``J_l(w)`` (..., 3, 3) with ``exp([w + dw]x) = exp([J_l dw]x) exp([w]x)`` to first order.

    ``J_l = I + (1 - cos a)/a^2 [w]x + (a - sin a)/a^3 [w]x^2`` for the angle a.
    """
    angle = np.linalg.norm(w, axis=-1)[..., None, None]
    safe = np.where(angle < SMALL_VECTOR, 1.0, angle)
    closed = (safe - np.sin(safe)) / safe**3
    second = np.where(angle < SMALL_VECTOR, 1 / 6 - angle**2 / 120, closed)
    S = skew(w)
    return np.eye(3) + 0.5 * _sinc(0.5 * angle) ** 2 * S + second * (S @ S)


def transform(position: ArrayLike = (0, 0, 0), rpy: ArrayLike = (0, 0, 0)) -> Array:
    """Place one frame in another.

    Args:
        position: Origin (3,) of the frame [m].
        rpy: Roll, pitch and yaw (3,) about the fixed x, y and z axes, in this order [rad].

    Returns:
        Homogeneous transform (4, 4) [m].
    """
    T = np.eye(4)
    if np.any(rpy):
        T[:3, :3] = _rotation(np.asarray(rpy, dtype=float))
    T[:3, 3] = position
    return T


def _rotation(rpy: Array) -> Array:
    """``Rz(yaw) Ry(pitch) Rx(roll)`` (3, 3), written out: scipy's takes 0.2 s to import."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpy), np.cos(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def aligned(axis: Array) -> Array:
    """A rotation (3, 3) whose third column is the axis.

    For a coordinate axis it is a signed permutation.
    """
    x = np.eye(3)[np.argmin(np.abs(axis))]
    x = x - axis * (axis @ x)
    x /= np.linalg.norm(x)
    return np.column_stack([x, vector_product(axis, x), axis])


# Rounding of sums and products along a chain of joints, relative to the size of their terms.
ROUNDING = 64 * np.finfo(float).eps


def without_rounding(x: Array, size: ArrayLike) -> Array:
    """Numbers x, of which those that are the rounding of numbers of that size are set to zero.

    A joint that the load does not turn, or whose axis runs through the tool point, then has an
    exactly zero column; left as rounding noise, it would be scaled up and pass as identified.
    """
    return np.where(np.abs(x) <= ROUNDING * np.asarray(size), 0.0, x)
