"""A batched Levenberg-Marquardt descent of fits of an arm to positions."""

from dataclasses import replace

import numpy as np

from edtk.inference.controller_search.fits import Fits
from edtk.inference.controller_search.positions import Positions
from edtk.model.frames import Frames
from edtk.model.robot import Robot
from edtk.model.vector_product import vector_product
from edtk.system.typing import Array

FIRST_DAMPING = 1e-3  # beside the diagonal of the normal matrix
EASIER = 0.2  # factor of the damping after a step that helped
HARDER = 5.0  # and after one that did not
DAMPING = (1e-9, 1e6)
TINY = 1e-12  # of the largest diagonal entry, so that parameters without effect stay


def descend(robot: Robot, fits: Fits, positions: Positions, free: list[int], steps: int) -> Fits:
    """Improve offsets, frames and markers of many fits at once.

    Args:
        robot: The chain, its tool frame the flange.
        fits: Where to begin.
        positions: The measurements.
        free: Joints whose offsets may change.
        steps: Number of steps.
    """
    damping = np.full(len(fits), FIRST_DAMPING)
    frames = fits.frames(robot, positions)
    rotation, points = fits.arms(frames, positions)
    residual = fits.residual(points, positions)
    fits = fits.with_rms(residual, positions)
    for _ in range(steps):
        J = jacobian(fits, positions, frames, rotation, points, free)
        step = _step(J, residual, positions, damping)
        tried = moved(fits, step, free)
        _, tried_points = tried.arms(tried.frames(robot, positions), positions)
        tried = tried.with_rms(tried.residual(tried_points, positions), positions)
        better = tried.rms < fits.rms
        fits = fits.better_of(tried)
        damping = np.clip(damping * np.where(better, EASIER, HARDER), *DAMPING)
        frames = fits.frames(robot, positions)
        rotation, points = fits.arms(frames, positions)
        residual = fits.residual(points, positions)
    return fits


def jacobian(
    fits: Fits,
    positions: Positions,
    frames: Frames,
    rotation: Array,
    points: Array,
    free: list[int],
) -> Array:
    """Derivatives (b, m, 3, f + 6 + 3k) of the predicted positions.

    Columns are the offsets of the free joints, a turn of the instrument's frame about its own axes,
    its shift, and the markers.
    """
    markers = fits.marker.shape[1]
    f = len(free)
    J = np.zeros((*points.shape, f + 6 + 3 * markers))
    back = np.swapaxes(fits.turn, 1, 2)
    arm = points - np.moveaxis(frames.position, 0, -1)[:, positions.pose]
    for column, j in enumerate(free):
        turn = np.moveaxis(frames.angular[j], 0, -1)[:, positions.pose]
        of_flange = np.moveaxis(frames.linear[j], 0, -1)[:, positions.pose]
        J[..., column] = (of_flange + vector_product(turn, arm)) @ back
    seen = points @ back
    for i, axis in enumerate(np.eye(3)):
        J[..., f + i] = vector_product(axis, seen)
        J[..., i, f + 3 + i] = 1.0
    turned = fits.turn[:, None] @ rotation
    for k in range(markers):
        own = positions.marker == k
        J[:, own, :, f + 6 + 3 * k : f + 9 + 3 * k] = turned[:, own]
    return J


def _step(J: Array, residual: Array, positions: Positions, damping: Array) -> Array:
    """Damped Gauss-Newton steps (b, c)."""
    root = np.sqrt(positions.count)[:, None]
    flat = (J * root[..., None]).reshape(len(J), -1, J.shape[-1])
    left = (residual * root).reshape(len(J), -1, 1)
    transposed = np.swapaxes(flat, 1, 2)
    normal = transposed @ flat
    diagonal = np.einsum("bii->bi", normal)
    floor = TINY * diagonal.max(axis=1, keepdims=True)
    lifted = damping[:, None] * diagonal + floor
    columns = np.arange(J.shape[-1])
    normal[:, columns, columns] += lifted
    return np.asarray(np.linalg.solve(normal, transposed @ left)[..., 0])


def moved(fits: Fits, step: Array, free: list[int]) -> Fits:
    """The fits after steps (b, f + 6 + 3k)."""
    from scipy.spatial.transform import Rotation

    f = len(free)
    offset = fits.offset.copy()
    offset[:, free] += step[:, :f]
    turn = Rotation.from_rotvec(step[:, f : f + 3]).as_matrix() @ fits.turn
    marker = fits.marker + step[:, f + 6 :].reshape(fits.marker.shape)
    shift = fits.shift + step[:, f + 3 : f + 6]
    return replace(fits, offset=offset, turn=turn, shift=shift, marker=marker)
