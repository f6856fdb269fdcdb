"""Where the robot stands and where the markers sit, without knowing anything of either."""

from dataclasses import dataclass

import numpy as np

from edtk.system.typing import Array, Mask

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

    Args:
        flange: Transforms (m, 4, 4) of the tool frame in the drawing's world [m].
        measured: Positions (m, k, 3) [m].
        seen: Which of them (m, k) there are.
        guess: Places (k, 3) of the markers in the tool frame [m]. Of places that fit equally well,
            as those along the axes of a SCARA, the nearest to these are taken.
    """
    k = seen.shape[1]
    pose, marker = np.nonzero(seen)
    center = measured[seen].mean(axis=0)
    size = max(float(np.sqrt(((measured[seen] - center) ** 2).mean())), 1e-12)
    x = (measured[pose, marker] - center) / size
    A = np.zeros((len(pose), 3, 12 + 3 * k))
    for axis in range(3):
        A[:, axis, 3 * axis : 3 * axis + 3] = x
        A[:, axis, 9 + axis] = 1.0
    each = np.arange(len(pose))
    for axis in range(3):
        A[each, :, 12 + 3 * marker + axis] = -flange[pose, :3, axis]
    A = A.reshape(-1, 12 + 3 * k)
    y = flange[pose, :3, 3].reshape(-1)
    U, values, Vt = np.linalg.svd(A, full_matrices=False)
    kept = values > OPEN * values[0]
    found = Vt[kept].T @ ((U[:, kept].T @ y) / values[kept])
    whole = (np.abs(Vt[~kept, :9]) < NOTHING).all()
    if guess is not None and whole and not kept.all():
        way = Vt[~kept]
        way[:, :9] = 0.0  # of rounding
        apart = guess.ravel() - found[12:]
        found = found + way.T @ np.linalg.lstsq(way[:, 12:].T, apart, rcond=None)[0]
    S = found[:9].reshape(3, 3) / size
    u, sizes, vt = np.linalg.svd(S)
    mirrored = bool(np.linalg.det(u @ vt) < 0)
    right = u @ np.diag([1.0, 1.0, -1.0 if mirrored else 1.0]) @ vt
    base = np.eye(4)
    base[:3, :3] = right.T
    tools = found[12:].reshape(k, 3)
    base[:3, 3] = _center(flange, measured, seen, right.T, tools)
    left = (A @ found - y).reshape(-1, 3)
    return LinearStart(
        base=base,
        tools=tools,
        scale=1.0 / float(np.median(sizes)) if np.median(sizes) > 0 else np.inf,
        mirrored=mirrored,
        distorted=bool(sizes.min() < ROUND * sizes.max()),
        rms=float(np.sqrt((left**2).sum(axis=-1).mean())),
        whole=bool(whole) and len(y) >= int(kept.sum()) + 3,
    )


def _center(flange: Array, measured: Array, seen: Mask, B: Array, tools: Array) -> Array:
    """Where the world's origin is (3,), given how it is turned."""
    points = flange[:, None, :3, 3] + np.einsum("mij,kj->mki", flange[:, :3, :3], tools)
    return np.asarray((measured - points @ B.T)[seen].mean(axis=0))
