"""Few convex shapes that contain triangles: capsules, and boxes where nothing moves them.

A convex set that holds the corners of a triangle holds all of it. So triangles are shared out among
pieces, those that lie across a cut are cut, and each piece gets a shape that holds all its corners:
the union contains every point of the surface, by construction. A piece whose shape stands far out
of the surface is cut in two, where that leaves the least volume, until all are tight or there are
enough of them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from edtk.cell.shapes import Box, Capsule
from edtk.system.typing import Array, Mask

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

Round = Capsule | Box
Fit = Callable[[Array, Array], Round]

# [m] by which shapes may stand out of the surface before they are cut in two: what two of them
# refuse is then 40 mm apart at most, where there are enough of them.
TIGHT = 0.02
CAPSULES_OF_PART = 4  # capsules of one part of an arm; each costs time in each pose
LEAST_RADIUS = 1e-4  # [m]; of flat or thin parts
ROUNDING = 1e-9  # by which shapes are larger, relative, so that rounding leaves no corner outside
CIRCLE_ROUNDS = 16  # of the search for the middle of a circle, whose error falls as 1 / rounds
STRETCHES = np.array([1.0, 1.04, 1.1, 1.2])  # of a capsule's least radius: thicker may be shorter
SHARES = (0.12, 0.3, 0.5, 0.7, 0.88)  # of the surface, before a cut
CORNERS_AT_ONCE = 100_000  # whose heights in all directions are in memory together
SURFACE_POINTS = 3000  # points of a surface, to which distances are measured
CLOSER = (0.3, 0.1, 0.03)  # [rad] about the best axis so far, among which a better one is sought


def _spread_directions(count: int) -> Array:
    """Unit vectors (count, 3) that fill the upper half of the sphere evenly, by a spiral."""
    height = (np.arange(count) + 0.5) / count
    angle = np.pi * (1 + 5**0.5) * np.arange(count)
    flat = np.sqrt(1 - height**2)
    return np.column_stack([flat * np.cos(angle), flat * np.sin(angle), height])


EXTREMES = np.concatenate([_spread_directions(32), -_spread_directions(32)])
AXES = _spread_directions(60)


def containing(
    triangles: Array, tight: float = TIGHT, most: int = CAPSULES_OF_PART, boxes: bool = False
) -> tuple[Round, ...]:
    """Shapes whose union contains all points of triangles.

    Args:
        triangles: Corners (f, 3, 3) [m].
        tight: How far shapes may stand out of the surface before they are cut in two [m].
        most: Shapes at most.
        boxes: Whether a piece may get a box along the axes, where that is smaller than a capsule.

    Returns:
        One shape at least; those that others hold are left out.
    """
    from scipy.spatial import cKDTree

    points, between = sampled(triangles, SURFACE_POINTS)
    surface = cKDTree(points), between
    fit = _smallest if boxes else _capsule
    pieces = [_Piece(triangles, fit, surface)]
    done: list[_Piece] = []
    while pieces and len(pieces) + len(done) < most:
        out = [_stands_out(one, [*pieces, *done]) for one in pieces]
        worst = int(np.argmax(out))
        if out[worst] <= tight:
            break
        piece = pieces.pop(worst)
        parts = piece.cut()
        pieces += parts
        done += [] if parts else [piece]
    return _without_held([one.shape for one in (*pieces, *done)])


@dataclass(frozen=True, eq=False)
class _Piece:
    """Triangles (f, 3, 3) [m] that one shape is to hold, and how such a shape is found.

    The surface is that of the whole part: points of it, and how far any other one is from these.
    """

    triangles: Array
    fit: Fit
    surface: "tuple[cKDTree, float]"

    @cached_property
    def corners(self) -> Array:
        """All corners (k, 3)."""
        return self.triangles.reshape(-1, 3)

    @cached_property
    def few(self) -> Array:
        """The corners that are extreme in some direction."""
        heights, tops = [], []
        for first in range(0, len(self.corners), CORNERS_AT_ONCE):
            height = self.corners[first : first + CORNERS_AT_ONCE] @ EXTREMES.T
            heights.append(height.max(axis=0))
            tops.append(first + height.argmax(axis=0))
        highest = np.argmax(heights, axis=0)
        return self.corners[np.unique(np.array(tops)[highest, np.arange(len(EXTREMES))])]

    @cached_property
    def axes(self) -> Array:
        """Principal axes (3, 3) of these corners, by rows; the longest one first."""
        return np.asarray(np.linalg.svd(self.few - self.few.mean(axis=0))[2])

    @cached_property
    def rough(self) -> float:
        """About the volume of the shape [m^3], by a few axes."""
        return _volume(self.fit(self.few, self.axes))

    @cached_property
    def shape(self) -> Round:
        """The shape that holds all corners, along the best axis of many."""
        found = self.fit(self.few, np.concatenate([self.axes, AXES]))
        for angle in CLOSER:
            axis = _axis(found)
            near = axis + angle * EXTREMES
            near = np.concatenate([axis[None], near / np.linalg.norm(near, axis=1)[:, None]])
            found = self.fit(self.few, near)
        return self.fit(self.corners, _axis(found)[None])

    @cached_property
    def around(self) -> tuple[Array, Array]:
        """Points (k, 3) all over the shape, and how far (k,) each is off the surface [m]."""
        points = _surface_of(self.shape)
        tree, between = self.surface
        return points, np.asarray(tree.query(points)[0] - between)

    def cut(self) -> "list[_Piece]":
        """The two pieces whose shapes have the least volume together; none where nothing parts."""
        middles = self.triangles.mean(axis=1)
        areas = _areas(self.triangles) + np.finfo(float).tiny
        found: list[tuple[float, int, list[_Piece]]] = []
        for axis in self.axes:
            for place in _places(middles @ axis, areas):
                two = [
                    _Piece(part, self.fit, self.surface)
                    for part in _cut(self.triangles, axis, place)
                ]
                if all(len(part.triangles) for part in two):
                    found.append((sum(part.rough for part in two), len(found), two))
        return min(found)[2] if found else []


def _places(along: Array, areas: Array) -> Array:
    """Where to cut: places along an axis before which there are given shares of the surface."""
    order = np.argsort(along)
    share = np.cumsum(areas[order])
    index = np.searchsorted(share, np.multiply(SHARES, share[-1]))
    return np.unique(along[order][np.minimum(index, len(along) - 1)])


def _cut(triangles: Array, axis: Array, place: float) -> tuple[Array, Array]:
    """The parts (f, 3, 3) of triangles below and above a plane.

    A triangle across it has one corner on one side, alone: that side gets a triangle, the other
    one two.
    """
    height = triangles @ axis - place
    above = height > 0
    count = above.sum(axis=1)
    sides = {False: [triangles[count == 0]], True: [triangles[count == 3]]}
    for alone in (True, False):
        across = count == (1 if alone else 2)
        T, h = triangles[across], height[across]
        first = (above[across] == alone).argmax(axis=1)
        turn = (first[:, None] + np.arange(3)) % 3
        row = np.arange(len(T))[:, None]
        T, h = T[row, turn], h[row, turn]
        # Where the edges from the lone corner meet the plane.
        part = h[:, :1] / (h[:, :1] - h[:, 1:])
        met = T[:, :1] + part[:, :, None] * (T[:, 1:] - T[:, :1])
        sides[alone].append(np.stack([T[:, 0], met[:, 0], met[:, 1]], axis=1))
        sides[not alone].append(np.stack([met[:, 0], T[:, 1], T[:, 2]], axis=1))
        sides[not alone].append(np.stack([met[:, 0], T[:, 2], met[:, 1]], axis=1))
    return np.concatenate(sides[False]), np.concatenate(sides[True])


def _capsule(points: Array, axes: Array) -> Capsule:
    """The capsule of least volume ``pi r^2 (l + 4/3 r)`` along one of some axes that holds points.

    Along an axis its radius is at least that of the smallest circle around the points as seen
    along it. With the distances d from the line through the circle's middle, a point at the height
    t is held by a cap whose middle is not farther from it than ``sqrt(r^2 - d^2)``: so the segment
    ends at ``max(t - sqrt(r^2 - d^2))`` and at ``min(t + sqrt(r^2 - d^2))``. If these have changed
    places, a ball holds all points.

    Args:
        points: Points (k, 3) [m].
        axes: Unit vectors (d, 3).
    """
    across = _across(axes)
    flat = np.einsum("dic,kc->dki", across, points)
    middle = _circle_middles(flat)
    distance = np.linalg.norm(flat - middle[:, None], axis=2)
    least = np.maximum(distance.max(axis=1), LEAST_RADIUS)
    radius = least[:, None] * STRETCHES
    height = axes @ points.T
    reach = np.sqrt(np.square(radius)[:, :, None] - np.square(distance)[:, None])
    top = (height[:, None] - reach).max(axis=2)
    bottom = (height[:, None] + reach).min(axis=2)
    length = np.maximum(top - bottom, 0.0)
    volume = np.pi * np.square(radius) * (length + 4 / 3 * radius)
    d, s = np.unravel_index(volume.argmin(), volume.shape)
    start = middle[d] @ across[d]
    ends = (bottom[d, s], top[d, s])
    if length[d, s] == 0:
        ends = (sum(ends) / 2,) * 2
    held = (1 + ROUNDING) * radius[d, s] + ROUNDING * np.abs(points).max()
    return Capsule(start + ends[0] * axes[d], start + ends[1] * axes[d], float(held))


def _across(axes: Array) -> Array:
    """Two unit vectors (d, 2, 3) across each of some axes (d, 3), and across each other."""
    other = np.eye(3)[np.abs(axes).argmin(axis=1)]
    first = np.cross(axes, other)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(axes, first)], axis=1)


def _circle_middles(points: Array) -> Array:
    """About the middles (d, 2) of the smallest circles around points (d, k, 2).

    Badoiu and Clarkson's steps: towards the farthest point, ``1 / (i + 1)`` of the way.
    """
    middle = (points.max(axis=1) + points.min(axis=1)) / 2
    row = np.arange(len(points))
    for i in range(1, CIRCLE_ROUNDS):
        away = points - middle[:, None]
        far = np.einsum("dki,dki->dk", away, away).argmax(axis=1)
        middle = middle + away[row, far] / (i + 2)
    return np.asarray(middle)


def _box(points: Array) -> Box:
    """The box along the axes of the frame that holds points (k, 3) [m]."""
    low, high = points.min(axis=0), points.max(axis=0)
    pose = np.eye(4)
    pose[:3, 3] = (low + high) / 2
    half = (1 + ROUNDING) * (high - low) / 2
    return Box(pose, np.maximum(half, LEAST_RADIUS) + ROUNDING * np.abs(points).max())


def _smallest(points: Array, axes: Array) -> Round:
    """A box or a capsule, whichever is smaller."""
    box = _box(points)
    capsule = _capsule(points, axes)
    return box if _volume(box) <= _volume(capsule) else capsule


def _axis(shape: Round) -> Array:
    """The unit vector along a capsule; of a box and a ball any."""
    if isinstance(shape, Capsule) and shape.length > 0:
        return (shape.end - shape.start) / shape.length
    return np.array([0.0, 0.0, 1.0])


def _volume(shape: Round) -> float:
    """The volume [m^3]."""
    if isinstance(shape, Box):
        return float(8 * np.prod(shape.half))
    return float(np.pi * shape.radius**2 * (shape.length + 4 / 3 * shape.radius))


def _areas(triangles: Array) -> Array:
    """Areas (f,) [m^2]."""
    first, second, third = np.moveaxis(triangles, 1, 0)
    return np.asarray(np.linalg.norm(np.cross(second - first, third - first), axis=1) / 2)


def sampled(triangles: Array, count: int) -> tuple[Array, float]:
    """Points (k, 3) of a surface, and how far any point of it is from one of these at most [m].

    Triangles are halved along their longest edge until none has an edge above a length l that
    leaves about as many as are asked for; the points are their middles. No point of a triangle is
    farther from it than two thirds of the longest median, which is not longer than ``sqrt(3)/2 l``.
    """
    spacing = np.sqrt(_areas(triangles).sum() / count)
    found = []
    while len(triangles):
        edges = triangles[:, [1, 2, 0]] - triangles
        lengths = np.linalg.norm(edges, axis=2)
        large = lengths.max(axis=1) > 2 * spacing
        found.append(triangles[~large].mean(axis=1))
        T = triangles[large]
        turn = (lengths[large].argmax(axis=1)[:, None] + np.arange(3)) % 3
        T = T[np.arange(len(T))[:, None], turn]
        middle = T[:, :2].mean(axis=1)
        first = np.stack([T[:, 0], middle, T[:, 2]], axis=1)
        triangles = np.concatenate([first, np.stack([middle, T[:, 1], T[:, 2]], axis=1)])
    return np.concatenate(found), float(2 * spacing / 3**0.5)


def _stands_out(piece: _Piece, pieces: Sequence[_Piece]) -> float:
    """How far a piece's shape stands out of the surface, where no other shape covers it [m]."""
    points, out = piece.around
    for other in pieces:
        if other is not piece:
            outside = ~inside(other.shape, points)
            points, out = points[outside], out[outside]
    return float(out.max()) if len(out) else 0.0


def _surface_of(shape: Round) -> Array:
    """Points (k, 3) all over the surface of a shape [m]."""
    if isinstance(shape, Box):
        ends = [(1 - 2 * (np.arange(9) / 8)) * half for half in shape.half]
        grid = np.stack(np.meshgrid(*ends, indexing="ij"), axis=-1).reshape(-1, 3)
        on = np.isclose(np.abs(grid), shape.half).any(axis=1)
        return np.asarray(grid[on] @ shape.pose[:3, :3].T + shape.pose[:3, 3])
    axis = _axis(shape)
    ball = shape.radius * EXTREMES
    upper = ball @ axis > 0
    places = np.linspace(0, 1, 9)[:, None, None]
    around = ball - np.outer(ball @ axis, axis)
    around *= (shape.radius / np.linalg.norm(around, axis=1))[:, None]
    tube = shape.start + places * (shape.end - shape.start) + around[::4]
    return np.concatenate([shape.start + ball[~upper], shape.end + ball[upper], *tube])


def inside(shape: Round, points: Array) -> Mask:
    """Whether a shape holds each of some points (k, 3) [m]."""
    if isinstance(shape, Box):
        local = (points - shape.pose[:3, 3]) @ shape.pose[:3, :3]
        return np.asarray((np.abs(local) <= shape.half).all(axis=1))
    way = shape.end - shape.start
    square = way @ way
    part = np.clip((points - shape.start) @ way / square, 0, 1) if square else np.zeros(len(points))
    away = points - shape.start - part[:, None] * way
    return np.asarray(np.linalg.norm(away, axis=1) <= shape.radius)


def _without_held(shapes: list[Round]) -> tuple[Round, ...]:
    """The shapes without capsules that another capsule holds: whose end balls are both within."""
    kept = sorted(shapes, key=_volume)
    found: list[Round] = []
    while kept:
        one = kept.pop(0)
        if not any(_holds(other, one) for other in kept):
            found.append(one)
    return tuple(found)


def _holds(outer: Round, inner: Round) -> bool:
    """Whether one capsule lies within another one."""
    if not isinstance(outer, Capsule) or not isinstance(inner, Capsule):
        return False
    less = outer.radius - inner.radius
    if less <= 0:
        return False
    core = Capsule(outer.start, outer.end, less)
    return bool(inside(core, np.stack([inner.start, inner.end])).all())
