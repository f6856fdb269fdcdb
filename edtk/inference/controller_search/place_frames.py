"""First guesses of the instrument's frame and the markers' places, in closed form."""

from dataclasses import replace

import numpy as np

from edtk.inference.controller_search.fits import Fits
from edtk.inference.controller_search.positions import Positions
from edtk.model.robot import Robot
from edtk.system.typing import Array

ROUNDS = 2
RIDGE = 1e-9  # for poses in which the flange hardly turns, so that no marker's place is told


def place_frames(robot: Robot, fits: Fits, positions: Positions) -> Fits:
    """Fit frame and markers in turn, for counts of the joints that are taken as true.

    With the markers known, the frame is that of two sets of points (Kabsch 1976). With its rotation
    known, markers and origin are linear least squares: ``W' y = R m + p + u`` with ``u = W' t``.
    Markers begin at the flange.
    """
    frames = fits.frames(robot, positions)
    marker = np.zeros_like(fits.marker)
    fits = replace(fits, marker=marker)
    for _ in range(ROUNDS):
        rotation, points = fits.arms(frames, positions)
        turn = _turn(points, positions.measured)
        place = np.moveaxis(frames.position, 0, -1)[:, positions.pose]
        seen = positions.measured @ turn - place
        marker, origin = _markers(rotation, seen, positions, fits.marker.shape[1])
        shift = (turn @ origin[..., None])[..., 0]
        fits = replace(fits, turn=turn, shift=shift, marker=marker)
    _, points = fits.arms(frames, positions)
    return fits.with_rms(fits.residual(points, positions), positions)


def _turn(points: Array, measured: Array) -> Array:
    """The rotations (b, 3, 3) that bring points (b, m, 3) nearest to measured ones (m, 3)."""
    centred = points - points.mean(axis=1, keepdims=True)
    covariance = np.swapaxes(centred, 1, 2) @ (measured - measured.mean(axis=0))
    U, _, V = np.linalg.svd(covariance)
    # Without a mirror image, however the points lie.
    handed = np.sign(np.linalg.det(U) * np.linalg.det(V))
    U = U * np.stack([np.ones_like(handed), np.ones_like(handed), handed], axis=-1)[:, None]
    return np.asarray(np.swapaxes(U @ V, 1, 2))


def _markers(
    rotation: Array, seen: Array, positions: Positions, markers: int
) -> tuple[Array, Array]:
    """Markers (b, k, 3) and origin u (b, 3) that fit ``seen = R m + u`` (b, m, 3) best.

    The markers are eliminated: m_k is the mean of R' (seen - u) over the positions of marker k.
    """
    share = (positions.marker[:, None] == np.arange(markers)).astype(float)
    number = share.sum(axis=0)
    share /= number
    back = (np.swapaxes(rotation, -1, -2) @ seen[..., None])[..., 0]
    mean_back = np.einsum("mk,bmi->bki", share, back)
    mean_rotation = np.einsum("mk,bmij->bkij", share, rotation)
    pull = np.einsum("k,bkij,bklj->bil", number, mean_rotation, mean_rotation)
    left = seen.sum(axis=1) - np.einsum("k,bkij,bkj->bi", number, mean_rotation, mean_back)
    normal = len(positions) * (1 + RIDGE) * np.eye(3) - pull
    origin = np.linalg.solve(normal, left[..., None])[..., 0]
    return mean_back - np.einsum("bkji,bj->bki", mean_rotation, origin), origin
