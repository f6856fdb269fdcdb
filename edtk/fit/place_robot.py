"""Where the robot stands and its markers sit, with the geometry of the drawing."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from criteria.linalg.inverse import eigenpairs
from edtk.fit.marker_positions import MarkerPositions
from edtk.fit.pose_rows import (
    MOST_EVALUATIONS,
    LeastSquaresFit,
    columns_of,
    least_squares_fit,
    measured_less_seen,
)
from edtk.measure.measured_model import MeasuredModel
from edtk.measure.parameters import COMPONENTS, TOLD, Parameter
from edtk.robots.frames import MM
from edtk.robots.rotations import rotation, rotation_vectors
from edtk.system.typing import Array, Indices, Mask

# Singular values of the linear problem below this share of the largest leave a direction open.
OPEN = TOLD
ROUND = 0.7  # of the largest scale of the matrix the smallest is at least, where it is a rotation
NOTHING = TOLD  # of an open direction of unit length that is of the matrix
SOME = 6  # from each other place; the best of them go on to the end
PROMISING = 4
STILL = TOLD  # singular value beside the largest of a direction that moves no marker
SAME_COST = 1e-6  # relative difference of costs that rounding makes
GOOD = 0.02  # of the spread of positions: a place that fits as well is not searched further


def rigid_motion(points: Array, goals: Array) -> Array:
    """The motion T (4, 4) that takes points (r, 3) nearest to goals (r, 3) (Kabsch 1976)."""
    a = points.mean(axis=0)
    b = goals.mean(axis=0)
    U, _, Vt = np.linalg.svd((points - a).T @ (goals - b))
    turn = np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
    R = (U @ turn @ Vt).T
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = b - R @ a
    return T


@dataclass(frozen=True, eq=False)
class LinearStart:
    """A place of the robot and of its markers that fits measured positions.

    Attributes:
        base: Transform (4, 4) of the robot's world in the frame of the instrument [m].
        tools: Markers (k, 3) in the tool frame [m].
        scale: Lengths measured over those of the drawing, 1 where units agree.
        mirrored: Whether a left-handed frame fits better than a right-handed one.
        distorted: Whether lengths in some direction fit much better with another scale.
        rms: Root mean square distance that the linear problem leaves, in the drawing's lengths [m].
        whole: Whether the poses tell the matrix, and so orientation and scale. Places of base and
            markers may be open together, as along the axes of a SCARA: that moves no position.
    """

    base: Array
    tools: Array
    scale: float
    mirrored: bool
    distorted: bool
    rms: float
    whole: bool


def linear_start(
    carried: Array, measured: Array, seen: Mask, guess: Array | None = None
) -> LinearStart:
    """Solve ``S x = R_i t_j + p_i + c`` for the matrix S and the vectors t_j and c at once.

    Of a robot at (B, b) that measures ``x = B (R t + p) + b`` it is ``S = B'`` and ``c = B' b``:
    linear in S, so that no first guess is needed. S is then turned into the nearest rotation, and
    its size tells the unit of the positions (after hand-eye calibration, Andreff et al. 2001).

    A marker's t_j is in its own rows alone, ``t_j = mean_i R_i' (S x - p_i - c)``, and is
    eliminated: twelve unknowns remain, whatever the number of markers.

    Args:
        carried: Transforms (m, 4, 4) of the tool frame in the drawing's world, or (m, k, 4, 4) of
            the body that each marker is on [m].
        measured: Positions (m, k, 3) [m].
        seen: Which of them (m, k) there are.
        guess: Places (k, 3) of the markers in the tool frame [m]. Of places that fit equally well,
            as those along the axes of a SCARA, the nearest to these are taken.
    """
    pose, marker = np.nonzero(seen)
    frames = carried[:, None] if carried.ndim == 3 else carried
    frames = np.broadcast_to(frames, (*seen.shape, 4, 4))
    A, size = _shared_columns(measured[seen])
    turn = frames[pose, marker, :3, :3]
    y = frames[pose, marker, :3, 3]
    alone = _Alone.of(turn, marker, seen.shape[1])
    found, rank, whole = alone.solved(A, y, guess)
    tools = found[12:].reshape(-1, 3)
    S = found[:9].reshape(3, 3) / size
    u, sizes, vt = np.linalg.svd(S)
    mirrored = bool(np.linalg.det(u @ vt) < 0)
    right = u @ np.diag([1.0, 1.0, -1.0 if mirrored else 1.0]) @ vt
    base = np.eye(4)
    base[:3, :3] = right.T
    base[:3, 3] = _center(frames, measured, seen, right.T, tools)
    left = A @ found[:12] - np.einsum("nij,nj->ni", turn, tools[marker]) - y
    return LinearStart(
        base=base,
        tools=tools,
        scale=1.0 / float(sizes[1]) if sizes[1] > 0 else np.inf,
        mirrored=mirrored,
        distorted=bool(sizes[2] < ROUND * sizes[0]),
        rms=float(np.sqrt((left**2).sum(axis=-1).mean())),
        whole=whole and y.size >= rank + 3,
    )


def linear_misfits(carried: Array, measured: Array, seen: Mask) -> Array:
    """What `linear_start` leaves (w,) of many chains at once, root mean square [m].

    By normal equations: rounding is some 1e-8 of the size of all positions.

    Args:
        carried: Transforms (w, m, 4, 4) of the tool frame [m].
        measured: Positions (m, k, 3) [m].
        seen: Which of them (m, k) there are.
    """
    pose, marker = np.nonzero(seen)
    A, _ = _shared_columns(measured[seen])
    flat = A.reshape(-1, 12)
    w = len(carried)
    frames = carried[:, pose]
    turned = np.swapaxes(frames[..., :3, :3], 2, 3)
    y = frames[..., :3, 3]
    # What the places of markers take up, by means of each marker over the root of their number.
    own = marker == np.arange(seen.shape[1])[:, None]
    share = own / np.sqrt(np.maximum(own.sum(axis=1), 1))[:, None]
    of_each = (share.T[:, None, :, None] * A[:, :, None]).reshape(len(flat), -1)
    taken = np.empty((w, 3, seen.shape[1], 13))
    by_axis = np.swapaxes(turned, 1, 2).reshape(3 * w, -1)
    taken[..., :12] = (by_axis @ of_each).reshape(w, 3, -1, 12)
    taken[..., 12] = np.swapaxes(share @ (turned @ y[..., None])[..., 0], 1, 2)
    G = np.empty((w, 13, 13))
    G[:, :12, :12] = flat.T @ flat
    G[:, 12, :12] = G[:, :12, 12] = y.reshape(w, -1) @ flat
    G[:, 12, 12] = np.square(y).sum(axis=(1, 2))
    by_place = taken.reshape(w, -1, 13)
    G -= np.swapaxes(by_place, 1, 2) @ by_place
    values, axes = eigenpairs(G[:, :12, :12])
    kept = values > OPEN**2 * values[:, -1:]
    along = (np.swapaxes(axes, 1, 2) @ G[:, :12, 12:])[..., 0]
    told = np.where(kept, along**2 / np.where(kept, values, 1.0), 0.0).sum(axis=1)
    return np.asarray(np.sqrt(np.maximum(G[:, 12, 12] - told, 0.0) / len(pose)))


def _shared_columns(x: Array) -> tuple[Array, float]:
    """Columns (N, 3, 12) of S and c, for positions (N, 3) that are centred, and over their size."""
    center = x.mean(axis=0)
    size = max(float(np.sqrt(((x - center) ** 2).mean())), 1e-12)
    A = np.zeros((len(x), 3, 12))
    for axis in range(3):
        A[:, axis, 3 * axis : 3 * axis + 3] = (x - center) / size
        A[:, axis, 9 + axis] = 1.0
    return A, size


@dataclass(frozen=True, eq=False)
class _Alone:
    """The unknowns of each marker, which stand in its own rows alone.

    Attributes:
        turn: Rotations R (N, 3, 3) of the rows.
        marker: Marker (N,) of each row.
        count: How many rows (k,) each has.
        share: What each row (k, N) counts in the mean of each marker.
    """

    turn: Array
    marker: Indices
    count: Indices
    share: Array

    @classmethod
    def of(cls, turn: Array, marker: Indices, k: int) -> "_Alone":
        """Of the rows of k markers."""
        count = np.bincount(marker, minlength=k)
        own = marker == np.arange(k)[:, None]
        return cls(turn, marker, count, own / np.maximum(count, 1)[:, None])

    def means(self, columns: Array) -> Array:
        """Means of ``R_i' v_i`` (k, 3, c), v (N, 3, c); zero for a marker without rows."""
        turned = np.swapaxes(self.turn, 1, 2) @ columns
        told = self.share @ turned.reshape(len(turned), -1)
        return np.asarray(told.reshape(-1, *columns.shape[1:]))

    def solved(self, A: Array, y: Array, guess: Array | None) -> tuple[Array, int, bool]:
        """Solve ``A s - R t_j = y`` by least squares.

        Args:
            A: Columns (N, 3, 12) of the unknowns that all rows share, nine of a matrix first.
            y: The right side (N, 3).
            guess: See `linear_start`.

        Returns:
            The shortest solution (12 + 3 k,), or the nearest to the guess; the rank; and whether
            the matrix is told.
        """
        both = np.concatenate([A, y[..., None]], axis=2)
        mean = self.means(both)
        # Rows of zeros: where there are fewer than twelve others, open directions are told, too.
        rows = np.zeros((y.size + 12, 13))
        rows[: y.size] = (both - self.turn @ mean[self.marker]).reshape(-1, 13)
        U, values, Vt = np.linalg.svd(rows[:, :12], full_matrices=False)
        kept = values > OPEN * values[0]
        first = Vt[kept].T @ ((U[:, kept].T @ rows[:, 12]) / values[kept])
        told = mean[..., :12]
        own = told @ first - mean[..., 12]
        found = np.concatenate([first, own.ravel()])
        # Open directions, with what they do to the markers; the shortest solution has none of them.
        open_ = Vt[~kept].T
        way = np.linalg.qr(np.vstack([open_, (told @ open_).reshape(own.size, -1)]))[0].T
        found = found - way.T @ (way @ found)
        whole = bool((np.abs(way[:, :9]) < NOTHING).all())
        if guess is not None:
            if whole and not kept.all():
                way[:, :9] = 0.0  # of rounding
                apart = guess.ravel() - found[12:]
                found = found + way.T @ np.linalg.lstsq(way[:, 12:].T, apart, rcond=None)[0]
            unseen = np.repeat(self.count == 0, 3)
            found[12:] = np.where(unseen, guess.ravel(), found[12:])
        return found, int(kept.sum()) + 3 * int((self.count > 0).sum()), whole


def _center(frames: Array, measured: Array, seen: Mask, B: Array, tools: Array) -> Array:
    """Where the world's origin is (3,), given how it is turned."""
    points = frames[..., :3, 3] + np.einsum("mkij,kj->mki", frames[..., :3, :3], tools)
    return np.asarray((measured - points @ B.T)[seen].mean(axis=0))


QUARTER = np.pi / 2


def first_place(model: MeasuredModel, means: MarkerPositions) -> LinearStart:
    """The linear solution for the place of robot and markers, see `linear_start`."""
    return linear_start(
        model.carried(means.q), means.measured, means.seen, np.asarray(model.offsets)
    )


def place_robot(model: MeasuredModel, means: MarkerPositions) -> tuple[MeasuredModel, Array]:
    """Find the base and the tools with which the drawing fits best.

    Starts are the linear solution, and where that does not lead near the positions, 24 orientations
    of the robot with the tools of the drawing; the best descent counts. Distances and differences
    do not say where a robot stands: where there are no absolute positions, it stays where it is.

    Args:
        model: Its parameters of base and tool are fitted, others stay zero.
        means: A visit a pose.

    Returns:
        The model with its base at the place found, and parameters (p,) for it: those of the tools
        are at their place, and all others zero.
    """
    read = np.flatnonzero(~model.is_distance)
    means = means.absolute.of_markers(read)
    if not means.seen.any():
        return model, np.zeros(model.p)
    of_read = model.of_markers(read)
    places = {one.place for one in of_read.parameters}
    placing = tuple(one for one in of_read.parameters if one.place in ("base", "tool"))
    only = of_read.with_parameters(placing)
    found: list[tuple[float, MeasuredModel, Array]] = []
    good = _good(means)
    tool_turns = any(one.place == "tool" and one.turns for one in placing)
    for start, tools in _starts(only, means, "base" in places, "tool" in places):
        there = replace(only, start=start)
        turned = _tool_turns(there, means) if tool_turns else np.zeros((len(there.markers), 3))
        every = np.concatenate([tools, turned], axis=1)
        values = [
            every[there.markers.index(one.of), COMPONENTS.index(one.component)]
            if one.place == "tool"
            else 0.0
            for one in placing
        ]
        fit = _fitted(there, np.array(values), means, SOME if found else MOST_EVALUATIONS)
        found.append((fit.cost, there, fit.theta))
        if fit.cost < good:
            break
    best, theta = _descended(found, means)
    at = dict(zip(best.parameters, theta, strict=True))
    whole = replace(model, start=_moved(best, at))
    values = [at.get(one, 0.0) if one.place == "tool" else 0.0 for one in whole.parameters]
    return whole, np.array(values)


def _tool_turns(model: MeasuredModel, means: MarkerPositions) -> Array:
    """Turns (k, 3) of the tools by which measured orientations are predicted from this base."""
    assert means.turns is not None
    tips = model.see(np.zeros(model.p), means.q, derivatives=False).turns
    turned = np.where(
        means.seen[..., None, None], np.swapaxes(tips, -1, -2) @ np.nan_to_num(means.turns), 0.0
    ).sum(axis=0)
    found = np.zeros((len(turned), 3))
    for i, one in enumerate(turned):
        U, _, Vt = np.linalg.svd(one)
        found[i] = rotation_vectors(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)
    return found


def _fitted(
    model: MeasuredModel, theta: Array, means: MarkerPositions, most: int
) -> LeastSquaresFit:
    """A fit that stays where it began along directions in which no marker moves.

    A step of Levenberg-Marquardt has some part along them: the base of a SCARA would sink by
    metres, and its markers rise on the tool; by a hundred where its axes are parallel to five
    digits, as that fits the tilts of a real one.
    """
    fit = least_squares_fit(model, theta, means, most=most)
    if not model.p:
        return fit
    columns = columns_of(model, means, model.see(fit.theta, means.q))
    _, sizes, Vt = np.linalg.svd(columns.compressed)
    still = Vt[np.append(sizes, np.zeros(model.p - len(sizes))) < STILL * sizes[0]]
    if not len(still):
        return fit
    moved = still.T @ (still @ ((fit.theta - theta) / model.scales))
    back = fit.theta - moved * model.scales
    apart = measured_less_seen(means, model.see(back, means.q, derivatives=False))
    cost = 0.5 * float(((MM * apart)[means.seen] ** 2).sum())
    # Where these directions bend, what moved stays.
    near = max(fit.cost * (1 + SAME_COST), _good(means))
    return replace(fit, theta=back, cost=cost) if cost <= near else fit


def _descended(
    found: list[tuple[float, MeasuredModel, Array]], means: MarkerPositions
) -> tuple[MeasuredModel, Array]:
    """The best of the most promising places, at its end."""
    if len(found) == 1:
        return found[0][1:]
    promising = sorted(found, key=lambda one: one[0])[:PROMISING]
    ends: list[tuple[float, MeasuredModel, Array]] = []
    for _, model, theta in promising:
        fit = _fitted(model, theta, means, MOST_EVALUATIONS)
        ends.append((fit.cost, model, fit.theta))
    return min(ends, key=lambda one: one[0])[1:]


def _moved(model: MeasuredModel, at: Mapping[Parameter, float]) -> Array:
    """The start of the base (4, 4), with its fitted motion."""
    motion = np.array([value for one, value in at.items() if one.place == "base"])
    start = model.start.copy()
    if len(motion):
        start[:3, 3] = start[:3, 3] + start[:3, :3] @ motion[:3]
        start[:3, :3] = start[:3, :3] @ rotation(motion[3:])
    return start


def _good(means: MarkerPositions) -> float:
    """The cost of a place that is near, by squared distances of all positions from their mean."""
    x = MM * means.measured[means.seen]
    return 0.5 * GOOD**2 * float(((x - x.mean(axis=0)) ** 2).sum())


def _starts(
    model: MeasuredModel, means: MarkerPositions, base: bool, tool: bool
) -> list[tuple[Array, Array]]:
    """Places to descend from: the base (4, 4) and the shifts of the markers (k, 3)."""
    nothing = np.zeros_like(model.offsets)
    if not base:
        return [(model.start, nothing)]
    starts = []
    if tool:
        linear = first_place(model, means)
        starts.append((linear.base, linear.tools - model.offsets))
    points = model.see(np.zeros(model.p), means.q, derivatives=False).points
    center = points[means.seen].mean(axis=0)
    goal = means.measured[means.seen].mean(axis=0)
    for R in _orientations():
        start = np.eye(4)
        start[:3, :3] = R
        start[:3, 3] = goal - R @ center
        starts.append((start, nothing))
    return starts


def _orientations() -> list[Array]:
    """The 24 rotations of a cube."""
    from scipy.spatial.transform import Rotation

    every = [
        Rotation.from_euler("xyz", np.array(turns) * QUARTER).as_matrix()
        for turns in product(range(4), repeat=3)
    ]
    rounded = {tuple(np.round(R).astype(int).ravel().tolist()): R for R in every}
    return [np.round(R) for R in rounded.values()]
