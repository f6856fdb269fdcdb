"""Many fits of an arm to positions at once: first guesses, and a batched descent."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import product

import numpy as np

from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.pose_rows import FIRST_DAMPING
from edtk.robots.frames import Frames
from edtk.robots.robot import Robot
from edtk.robots.rotations import vector_product
from edtk.system.typing import Array, Indices, Mask

STILL = 1e-6  # [rad or m]
TURNS_OF_FIT = 2
RIDGE = 1e-9  # for poses in which the flange hardly turns, so that no marker's place is told
FLAT = 1e-9  # singular value, beside the largest, below which points lie in a plane
EASIER = 0.2  # factor of the damping after a step that helped
HARDER = 5.0  # and after one that did not
DAMPING = (1e-9, 1e6)
TINY = 1e-12  # of the largest diagonal entry, so that parameters without effect stay


@dataclass(frozen=True, eq=False)
class Positions:
    """Positions of markers in poses, the mean of repeated ones.

    Attributes:
        shown: Values (p, n) that the controller shows in each pose [rad or m].
        pose: Pose (m,) of each position, by its index.
        marker: Marker (m,) of each position, by its index.
        measured: Positions (m, 3) in the frame of the instrument [m].
        count: How often each was measured (m,).
        names: Names of the markers (k,).
    """

    shown: Array
    pose: Indices
    marker: Indices
    measured: Array
    count: Indices
    names: tuple[str, ...]

    @classmethod
    def of_rows(cls, shown: Array, measured: Array, markers: Sequence[str]) -> "Positions":
        """Average the rows of one pose and marker.

        Args:
            shown: Values (r, n) that the controller shows [rad or m].
            measured: Positions (r, 3) [m].
            markers: Name of the marker of each row.
        """
        names = tuple(dict.fromkeys(markers))
        of_name = {name: i for i, name in enumerate(names)}
        marker = np.array([of_name[name] for name in markers])
        poses, pose = np.unique(shown, axis=0, return_inverse=True)
        key = pose.reshape(-1) * len(names) + marker
        kept, row, count = np.unique(key, return_inverse=True, return_counts=True)
        mean = np.zeros((len(kept), 3))
        np.add.at(mean, row.reshape(-1), measured)
        mean /= count[:, None]
        return cls(poses, kept // len(names), kept % len(names), mean, count, names)

    @classmethod
    def of_sheet(cls, sheet: MarkerPositions) -> "Positions":
        """Take the positions of a sheet, whose joint variables are what the controller shows."""
        visit, marker = np.nonzero(sheet.seen)
        names = [sheet.markers[i] for i in marker]
        return cls.of_rows(sheet.q[visit], sheet.measured[visit, marker], names)

    @property
    def moving(self) -> list[int]:
        """Joints that do not stand still in all poses."""
        return [int(j) for j in np.flatnonzero(np.ptp(self.shown, axis=0) > STILL)]

    def thinned(self, poses: int, marker: int | None) -> "Positions":
        """A part of the positions: poses spread over all, and one marker where one is named."""
        chosen = np.unique(np.linspace(0, len(self.shown) - 1, poses).round().astype(int))
        kept = np.isin(self.pose, chosen)
        if marker is not None:
            kept &= self.marker == marker
        used, pose = np.unique(self.pose[kept], return_inverse=True)
        return Positions(
            shown=self.shown[used],
            pose=pose.reshape(-1),
            marker=self.marker[kept] if marker is None else np.zeros(int(kept.sum()), dtype=int),
            measured=self.measured[kept],
            count=self.count[kept],
            names=self.names if marker is None else (self.names[marker],),
        )

    def __len__(self) -> int:
        return len(self.pose)


@dataclass(frozen=True, eq=False)
class Fits:
    """Ways to count the joints, with the frame of the instrument and the markers' places.

    The model's joints are ``q = L c + o`` for values c of the controller; a marker at m in the
    flange's frame, whose pose is (R, p), is seen at ``y = W (R m + p) + t``.

    Attributes:
        counting: Signs and couplings L (b, n, n).
        offset: Offsets o (b, n) [rad or m].
        turn: Rotations W (b, 3, 3) from the robot's base to the instrument.
        shift: Places t (b, 3) of the robot's base [m].
        marker: Places m (b, k, 3) of the markers in the flange's frame [m].
        rms: Root mean square (b,) of the distances that the fit leaves [m].
    """

    counting: Array
    offset: Array
    turn: Array
    shift: Array
    marker: Array
    rms: Array

    @classmethod
    def at(cls, counting: Array, offset: Array, markers: int) -> "Fits":
        """Ways to count whose frames and markers are not fitted yet."""
        b = len(offset)
        turn = np.broadcast_to(np.eye(3), (b, 3, 3))
        marker = np.zeros((b, markers, 3))
        return cls(counting, offset, turn, np.zeros((b, 3)), marker, np.full(b, np.inf))

    def __len__(self) -> int:
        return len(self.offset)

    def __getitem__(self, chosen: "Indices | Mask | slice") -> "Fits":
        return Fits(*(getattr(self, field.name)[chosen] for field in fields(self)))

    @classmethod
    def joined(cls, parts: list["Fits"]) -> "Fits":
        """All fits of several lots."""
        names = [field.name for field in fields(cls)]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    def better_of(self, other: "Fits") -> "Fits":
        """Of each pair of fits the one that leaves less."""
        better = other.rms < self.rms
        values = []
        for field in fields(self):
            own = getattr(self, field.name)
            lifted = better.reshape(-1, *(1,) * (own.ndim - 1))
            values.append(np.where(lifted, getattr(other, field.name), own))
        return Fits(*values)

    def frames(self, robot: Robot, positions: Positions) -> Frames:
        """Frames of all fits (b, p) in all poses; the tool frame is the flange's."""
        q = positions.shown @ np.swapaxes(self.counting, 1, 2) + self.offset[:, None]
        return robot.frames(q)

    def arms(self, frames: Frames, positions: Positions) -> tuple[Array, Array]:
        """Vectors R m (b, m, 3) and points R m + p (b, m, 3) of all positions, in the base."""
        rotation = np.moveaxis(frames.rotation, (0, 1), (-1, -2))[:, positions.pose]
        place = np.moveaxis(frames.position, 0, -1)[:, positions.pose]
        arm = (rotation @ self.marker[:, positions.marker, :, None])[..., 0]
        return rotation, place + arm

    def residual(self, points: Array, positions: Positions) -> Array:
        """Measured less predicted positions (b, m, 3) [m]."""
        seen = points @ np.swapaxes(self.turn, 1, 2) + self.shift[:, None]
        return np.asarray(positions.measured - seen)

    def with_rms(self, residual: Array, positions: Positions) -> "Fits":
        """The same fits with what they leave."""
        squares = ((residual**2).sum(axis=-1) * positions.count).sum(axis=-1)
        return replace(self, rms=np.sqrt(squares / positions.count.sum()))


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
    for _ in range(TURNS_OF_FIT - 1):
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
