"""Rotations by vectors, and how they change with them."""

import numpy as np

from edtk.system.typing import Array

# Angle [rad] below which closed forms cancel, and two terms of a series are exact.
SMALL = 1e-3


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
    """Rotations ``exp([w]x)`` (..., 3, 3) by vectors w (..., 3) [rad] (Rodrigues)."""
    angle = np.linalg.norm(w, axis=-1)[..., None, None]
    S = skew(w)
    half = np.sinc(angle / (2 * np.pi))
    return np.eye(3) + np.sinc(angle / np.pi) * S + 0.5 * half**2 * (S @ S)


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
    safe = np.where(angle < SMALL, 1.0, angle)
    closed = (safe - np.sin(safe)) / safe**3
    second = np.where(angle < SMALL, 1 / 6 - angle**2 / 120, closed)
    S = skew(w)
    return np.eye(3) + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * S + second * (S @ S)
