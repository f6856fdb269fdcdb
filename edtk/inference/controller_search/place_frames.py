"""First guesses of the instrument's frame and the markers' places, in closed form."""

from dataclasses import replace
from itertools import product

import numpy as np

from edtk.inference.controller_search.fits import Fits
from edtk.inference.controller_search.positions import Positions
from edtk.model.frames import Frames
from edtk.model.robot import Robot
from edtk.system.typing import Array

ROUNDS = 2
RIDGE = 1e-9  # for poses in which the flange hardly turns, so that no marker's place is told
FLAT = 1e-9  # singular value, beside the largest, below which points lie in a plane


def place_frames(robot: Robot, fits: Fits, positions: Positions) -> Fits:
    """Fit frame and markers in turn, for counts of the joints that are taken as true.

    With the markers known, the frame is that of two sets of points (Kabsch 1976). With its rotation
    known, markers and origin are linear least squares: ``W' y = R m + p + u`` with ``u = W' t``.
    Markers begin at the flange. Where it stays in a plane, as under parallel axes, a marker beside
    it may bring the plane to lie upside down; so all four ways are tried in which it can lie.
    """
    frames = fits.frames(robot, positions)
    fits = replace(fits, marker=np.zeros_like(fits.marker))
    _, points = fits.arms(frames, positions)
    U, size, V = _matched(points, positions.measured)
    flat = bool((size[:, 2] <= FLAT * size[:, 0]).any())
    tried = [
        _placed(fits, frames, _rotation(U, V, (first, second)), positions)
        for first, second in (product((1.0, -1.0), repeat=2) if flat else [(1.0, 1.0)])
    ]
    best = tried[0]
    for other in tried[1:]:
        best = best.better_of(other)
    return best


def _placed(fits: Fits, frames: Frames, turn: Array, positions: Positions) -> Fits:
    """Fits whose frames have been turned first (b, 3, 3), and then fitted in turn with markers."""
    fits = _with_markers(fits, frames, turn, positions)
    for _ in range(ROUNDS - 1):
        _, points = fits.arms(frames, positions)
        U, _, V = _matched(points, positions.measured)
        fits = _with_markers(fits, frames, _rotation(U, V), positions)
    _, points = fits.arms(frames, positions)
    return fits.with_rms(fits.residual(points, positions), positions)


def _with_markers(fits: Fits, frames: Frames, turn: Array, positions: Positions) -> Fits:
    """The fits with another rotation (b, 3, 3), and the markers and origin that suit it."""
    rotation, _ = fits.arms(frames, positions)
    place = np.moveaxis(frames.position, 0, -1)[:, positions.pose]
    seen = positions.measured @ turn - place
    marker, origin = _markers(rotation, seen, positions, fits.marker.shape[1])
    shift = (turn @ origin[..., None])[..., 0]
    return replace(fits, turn=turn, shift=shift, marker=marker)


def _matched(points: Array, measured: Array) -> tuple[Array, Array, Array]:
    """Singular value decomposition of the covariance of points (b, m, 3) with measured ones."""
    centred = points - points.mean(axis=1, keepdims=True)
    covariance = np.swapaxes(centred, 1, 2) @ (measured - measured.mean(axis=0))
    return np.linalg.svd(covariance)


def _rotation(U: Array, V: Array, signs: tuple[float, float] = (1.0, 1.0)) -> Array:
    """Rotations (b, 3, 3) that bring points nearest to measured ones, or their axes reversed.

    Args:
        U: Left singular vectors (b, 3, 3) of `_matched`.
        V: Right ones, transposed.
        signs: Signs of the two axes along which the points are spread most.
    """
    # Without a mirror image, however the points lie.
    handed = np.sign(np.linalg.det(U) * np.linalg.det(V)) * np.prod(signs)
    first = np.full_like(handed, signs[0])
    second = np.full_like(handed, signs[1])
    U = U * np.stack([first, second, handed], axis=-1)[:, None]
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
