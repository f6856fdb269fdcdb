"""Where the robot stands and where the markers sit, without knowing anything of either."""

from dataclasses import dataclass

import numpy as np

from edtk.system.typing import Array, Indices, Mask

# Singular values of the linear problem below this share of the largest leave a direction open.
OPEN = 1e-6
ROUND = 0.7  # of the largest scale of the matrix the smallest is at least, where it is a rotation
NOTHING = 1e-6  # of an open direction of unit length that is of the matrix: rounding


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
    flange: Array, measured: Array, seen: Mask, guess: Array | None = None
) -> LinearStart:
    """Solve ``S x = R_i t_j + p_i + c`` for the matrix S and the vectors t_j and c at once.

    Of a robot at (B, b) that measures ``x = B (R t + p) + b`` it is ``S = B'`` and ``c = B' b``:
    linear in S, so that no first guess is needed. S is then turned into the nearest rotation, and
    its size tells the unit of the positions (after hand-eye calibration, Andreff et al. 2001).

    A marker's t_j is in its own rows alone, ``t_j = mean_i R_i' (S x - p_i - c)``, and is
    eliminated: twelve unknowns remain, whatever the number of markers.

    Args:
        flange: Transforms (m, 4, 4) of the tool frame in the drawing's world [m].
        measured: Positions (m, k, 3) [m].
        seen: Which of them (m, k) there are.
        guess: Places (k, 3) of the markers in the tool frame [m]. Of places that fit equally well,
            as those along the axes of a SCARA, the nearest to these are taken.
    """
    pose, marker = np.nonzero(seen)
    center = measured[seen].mean(axis=0)
    size = max(float(np.sqrt(((measured[seen] - center) ** 2).mean())), 1e-12)
    x = (measured[pose, marker] - center) / size
    turn = flange[pose, :3, :3]
    A = np.zeros((len(pose), 3, 12))
    for axis in range(3):
        A[:, axis, 3 * axis : 3 * axis + 3] = x
        A[:, axis, 9 + axis] = 1.0
    y = flange[pose, :3, 3]
    alone = _Alone.of(turn, marker, seen.shape[1])
    found, rank, whole = alone.solved(A, y, guess)
    tools = found[12:].reshape(-1, 3)
    S = found[:9].reshape(3, 3) / size
    u, sizes, vt = np.linalg.svd(S)
    mirrored = bool(np.linalg.det(u @ vt) < 0)
    right = u @ np.diag([1.0, 1.0, -1.0 if mirrored else 1.0]) @ vt
    base = np.eye(4)
    base[:3, :3] = right.T
    base[:3, 3] = _center(flange, measured, seen, right.T, tools)
    left = A @ found[:12] - np.einsum("nij,nj->ni", turn, tools[marker]) - y
    return LinearStart(
        base=base,
        tools=tools,
        scale=1.0 / float(np.median(sizes)) if np.median(sizes) > 0 else np.inf,
        mirrored=mirrored,
        distorted=bool(sizes.min() < ROUND * sizes.max()),
        rms=float(np.sqrt((left**2).sum(axis=-1).mean())),
        whole=whole and y.size >= rank + 3,
    )


@dataclass(frozen=True, eq=False)
class _Alone:
    """The unknowns of each marker, which stand in its own rows alone.

    Attributes:
        turn: Rotations R (N, 3, 3) of the rows.
        marker: Marker (N,) of each row.
        count: How many rows (k,) each has.
    """

    turn: Array
    marker: Indices
    count: Indices

    @classmethod
    def of(cls, turn: Array, marker: Indices, k: int) -> "_Alone":
        """Of the rows of k markers."""
        return cls(turn, marker, np.bincount(marker, minlength=k))

    def means(self, columns: Array) -> Array:
        """Means of ``R_i' v_i`` (k, 3, c), v (N, 3, c); zero for a marker without rows."""
        told = np.zeros((len(self.count), 3, columns.shape[2]))
        np.add.at(told, self.marker, np.swapaxes(self.turn, 1, 2) @ columns)
        return np.asarray(told / np.maximum(self.count, 1)[:, None, None])

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
        told = self.means(A)
        reduced = A - self.turn @ told[self.marker]
        reached = y[..., None] - self.turn @ self.means(y[..., None])[self.marker]
        # Rows of zeros: where there are fewer than twelve others, open directions are told, too.
        rows = np.vstack([reduced.reshape(-1, 12), np.zeros((12, 12))])
        U, values, Vt = np.linalg.svd(rows, full_matrices=False)
        kept = values > OPEN * values[0]
        first = Vt[kept].T @ ((U[:-12, kept].T @ reached.ravel()) / values[kept])
        own = self.means(A @ first[:, None] - y[..., None])
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


def _center(flange: Array, measured: Array, seen: Mask, B: Array, tools: Array) -> Array:
    """Where the world's origin is (3,), given how it is turned."""
    points = flange[:, None, :3, 3] + np.einsum("mij,kj->mki", flange[:, :3, :3], tools)
    return np.asarray((measured - points @ B.T)[seen].mean(axis=0))
