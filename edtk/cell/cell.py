"""A robot among its surroundings: how far its bodies are from each other and from what stands."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, pairwise
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from criteria.linalg.inverse import TINY
from edtk.cell.distance import (
    Nearest,
    segment_to_box,
    segment_to_convex,
    segment_to_plane,
    segment_to_segment,
    signed_box,
    signed_cylinder,
)
from edtk.cell.shapes import Body, Box, Capsule, Cylinder, Plane, Shape, capsule_arrays
from edtk.robots.constraints.constraint import Constraint, Inequality
from edtk.robots.frames import Frames, cross
from edtk.robots.joint import MILLIMETRE
from edtk.robots.robot import Robot
from edtk.system.typing import Array, Indices, Mask

CHUNK = 4096  # poses that are looked at together: their arrays fit into a core's cache
ROUNDINGS = 40  # of sums of a few lengths each, in a lower bound of a distance
UNIT = 2.0**-24  # roundoff of single precision
# Of the slack that searches keep: pairs that are farther apart than this do not count, and the
# nearest of several counts like the least of them but for so much.
REACH = 0.05  # [m]
BLUR = 0.005  # [m]


@dataclass(frozen=True, eq=False)
class Clearance:
    """How free poses are: the least distance of all pairs of bodies, less the margin.

    Attributes:
        least: Clearances (...) [m]: negative where something touches; inf where the cell has
            nothing to look at.
        pair: Index (...) of the pair of bodies that is nearest, of `Cell.pairs`.
        pairs: Names of the two bodies of each pair.
    """

    least: Array
    pair: Indices
    pairs: tuple[tuple[str, str], ...]

    @property
    def free(self) -> Mask:
        """Whether nothing touches in each pose (...)."""
        return np.asarray(self.least >= 0)

    def names(self, index: int | tuple[int, ...]) -> tuple[str, str] | None:
        """Names of the nearest two bodies in one pose; None where there is nothing to look at."""
        return self.pairs[self.pair[index]] if self.pairs else None


@dataclass(frozen=True, eq=False)
class Cell:
    """A robot with its bodies, what it carries, and what stands around it.

    Args:
        robot: The chain that moves the bodies.
        bodies: The bodies, each with a name of its own; what moves is made of capsules.
        margin: Distance that is to be kept, beyond touching [m].
        pairs: Names of the two bodies of each pair to look at, see `every_pair`.

    Raises:
        ValueError: Two bodies have one name, or a pair names none, or two that move together.
    """

    robot: Robot
    bodies: tuple[Body, ...]
    margin: float
    pairs: tuple[tuple[str, str], ...]

    def __post_init__(self) -> None:
        named = {body.name: body for body in self.bodies}
        if len(named) < len(self.bodies):
            raise ValueError("two bodies have one name; expected a name of its own for each")
        for pair in self.pairs:
            for name in pair:
                if name not in named:
                    raise ValueError(f"no body {name!r}; the cell has {', '.join(named)}")
            if not move_against(*(named[name] for name in pair)):
                raise ValueError(f"bodies {pair[0]!r} and {pair[1]!r} move together")

    @cached_property
    def carriers(self) -> frozenset[int]:
        """Joints that move a body, as `Robot.frames` takes them."""
        return frozenset(body.carrier for body in self.bodies if body.carrier is not None)

    @cached_property
    def digest(self) -> str:
        """Digits that differ where a shape, the margin or a pair does."""
        solids = self.solids
        places = (solids.start, solids.end, solids.radius, solids.anchors, *solids.planes)
        text = f"{self.margin} {self.pairs} {solids.carriers.tolist()}".encode()
        numbers = (
            np.ascontiguousarray(one).tobytes() for one in (*places, *solids.standing.arrays)
        )
        return hashlib.sha256(b"".join([text, *numbers])).hexdigest()[:12]

    @cached_property
    def solids(self) -> "Solids":
        """The shapes as arrays, with the pairs of shapes that are looked at."""
        return Solids.of(self)

    def clearance(self, q: ArrayLike) -> Clearance:
        """How free the poses q (..., n) are, and which two bodies are nearest in each.

        Pairs are taken in the order of a cheap lower bound, and only as long as it is below the
        least distance so far.
        """
        flat, batch = self._flat(q)
        least = np.full(len(flat), np.inf)
        pair = np.zeros(len(flat), dtype=int)
        for part in chunks(len(flat)):
            near = self.solids.nearest(self._placed(flat[part]))
            least[part.start + near.pose] = near.nearest.distance
            pair[part.start + near.pose] = self.solids.bodies[near.pair]
        return Clearance(least.reshape(batch) - self.margin, pair.reshape(batch), self.pairs)

    def distances(self, q: ArrayLike) -> Array:
        """Distances (..., pairs) of all pairs of bodies in the poses q (..., n) [m].

        The margin is not taken off. They are signed: negative where bodies overlap, by how deep the
        middle line of one is in the other.
        """
        flat, batch = self._flat(q)
        found = np.empty((len(flat), len(self.pairs)))
        for part in chunks(len(flat)):
            found[part] = self.solids.all_distances(self._placed(flat[part]))
        return found.reshape(*batch, len(self.pairs))

    def free(self, q: ArrayLike) -> Mask:
        """Whether nothing touches in each of the poses q (..., n), the margin kept.

        Only pairs are looked at whose lower bound is below the margin, which takes a part of the
        time of `clearance`.
        """
        flat, batch = self._flat(q)
        found = np.ones(len(flat), dtype=bool)
        for part in chunks(len(flat)):
            near = self.solids.near(self._placed(flat[part]), self.margin)
            found[part.start + near.pose] = False
        return found.reshape(batch)

    def gradient(self, q: ArrayLike) -> Array:
        """Derivative (..., n) of the clearance of the poses q (..., n) [m/rad, or 1 if prismatic].

        Where two bodies with the nearest points x on the first and y on the second part along the
        unit vector u, it is ``u . (v_j(x) - w_j(x))`` with the velocities of the point x on each
        body by joint j. A joint that moves both has none: they move together.
        """
        flat, batch = self._flat(q)
        found = np.zeros(flat.shape)
        for part in chunks(len(flat)):
            frames = self.frames(flat[part])
            near = self.solids.nearest(self.solids.placed(frames))
            found[part.start + near.pose] = self.solids.slopes(frames, near).T
        return found.reshape(*batch, self.robot.n)

    def _flat(self, q: ArrayLike) -> tuple[Array, tuple[int, ...]]:
        """Poses one after another (N, n), and the shape of the batch."""
        q = np.asarray(q, dtype=float)
        return q.reshape(-1, q.shape[-1]), q.shape[:-1]

    def frames(self, q: Array) -> Frames:
        """Frames of the chain in poses (..., n), with those of all bodies that move."""
        return self.robot.frames(q, self.carriers)

    def _placed(self, q: Array) -> "Placed":
        return self.solids.placed(self.frames(q))


def move_against(one: Body, other: Body) -> bool:
    """Whether two bodies can move against each other: a weight swings where its carrier turns."""
    return one.carrier != other.carrier or (one.hangs_at is None) != (other.hangs_at is None)


def every_pair(bodies: Sequence[Body]) -> tuple[tuple[str, str], ...]:
    """Names of the two bodies of all pairs that do not move together."""
    return tuple(
        (one.name, other.name) for one, other in combinations(bodies, 2) if move_against(one, other)
    )


class Placed(NamedTuple):
    """Where the middle lines of all K capsules are in N poses: starts and ends (3, K, N) [m]."""

    start: Array
    end: Array


class Near(NamedTuple):
    """Pairs of shapes that are near, in some poses: index (k,) of pair and pose, and how near.

    Distances are those of the bodies: the capsules' radii are taken off.
    """

    pair: Indices
    pose: Indices
    nearest: Nearest

    def some(self, chosen: Indices) -> "Near":
        """Some of them."""
        found = self.nearest
        part = Nearest(found.distance[chosen], found.normal[:, chosen], found.point[:, chosen])
        return Near(self.pair[chosen], self.pose[chosen], part)

    def beside(self, others: "Near") -> "Near":
        """These, then others."""
        one, two = self.nearest, others.nearest
        both = Nearest(
            np.concatenate([one.distance, two.distance]),
            np.concatenate([one.normal, two.normal], axis=1),
            np.concatenate([one.point, two.point], axis=1),
        )
        return Near(
            np.concatenate([self.pair, others.pair]), np.concatenate([self.pose, others.pose]), both
        )


@dataclass(frozen=True, eq=False)
class _Standing:
    """What stands still: boxes, and behind them cylinders, which are searched together.

    Attributes:
        rotation: Their axes (S, 3, 3), each a row.
        middle: Their middles (S, 3) in their own axes [m].
        half: Half of each edge (3, S); of cylinders radius, radius and half the height [m].
        boxes: Number of boxes.
    """

    rotation: Array
    middle: Array
    half: Array
    boxes: int

    @classmethod
    def of(cls, boxes: Sequence[Box], cylinders: Sequence[Cylinder]) -> "_Standing":
        shapes: list[Box | Cylinder] = [*boxes, *cylinders]
        poses = np.array([shape.pose for shape in shapes]).reshape(-1, 4, 4)
        rotation = np.swapaxes(poses[:, :3, :3], 1, 2)
        middle = np.einsum("sij,sj->si", rotation, poses[:, :3, 3])
        half = [box.half for box in boxes]
        half += [np.array([one.radius, one.radius, one.half_height]) for one in cylinders]
        return cls(rotation, middle, np.array(half).reshape(-1, 3).T, len(boxes))

    @property
    def arrays(self) -> tuple[Array, ...]:
        """All its numbers, those of boxes first."""
        places = (self.rotation, self.middle)
        boxes = (*(one[: self.boxes] for one in places), self.half[:, : self.boxes])
        round_ones = (*(one[self.boxes :] for one in places), self.half[[0, 2], self.boxes :])
        return (*boxes, *round_ones)

    def of_points(self, x: NDArray[np.float32]) -> NDArray[np.float32]:
        """Signed distances (S, K, N) of points (3, K, N) [m].

        Of all pairs this takes most of the time: one shape after another, whose arrays stay in a
        core's cache.
        """
        flat = x.reshape(3, -1)
        found = np.empty((len(self.rotation), flat.shape[1]), x.dtype)
        places = (self.rotation, self.middle[:, :, None], self.half.T[:, :, None])
        shapes = zip(*(one.astype(x.dtype) for one in places), found, strict=True)
        for index, (rotation, middle, half, signed) in enumerate(shapes):
            own = rotation @ flat
            own -= middle
            np.abs(own, out=own)
            if index >= self.boxes:  # round about z: the second component is below the first
                own[0] = np.hypot(own[0], own[1])
                own[1] = 0.0
            own -= half
            inside = np.minimum(own.max(axis=0), 0.0)
            np.maximum(own, 0.0, out=own)
            own *= own
            np.sqrt(own[0] + own[1] + own[2], out=signed)
            signed += inside
        return found.reshape(-1, *x.shape[1:])

    def below(self, start: Array, end: Array) -> Array:
        """Lower bounds (S, k) on the distances of segments (3, k) [m], by directions that part.

        Along a unit vector, what lies between the shadows of a segment and of a solid is no more
        than their distance. Taken are the shape's axes, and what is across one of them and the
        segment: of boxes one of these has a gap wherever they are apart (Gottschalk, Lin and
        Manocha, OBBTree, 1996). A cylinder counts as round across its axis.
        """
        count, n = len(self.rotation), start.shape[1]
        half = self.half
        c = (self.rotation.reshape(-1, 3) @ (0.5 * (start + end))).reshape(count, 3, n)
        c -= self.middle[:, :, None]
        w = (self.rotation.reshape(-1, 3) @ (0.5 * (end - start))).reshape(count, 3, n)
        size = np.abs(w)
        gap = (np.abs(c) - size - half.T[:, :, None]).max(axis=1)
        for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
            length = np.maximum(np.hypot(w[:, j], w[:, k]), TINY)
            off = np.abs(c[:, j] * w[:, k] - c[:, k] * w[:, j]) / length
            across = half[j][:, None] * size[:, k] + half[k][:, None] * size[:, j]
            across /= length
            if i == 2:
                across[self.boxes :] = half[0, self.boxes :, None]
            np.maximum(gap, off - across, out=gap)
        return gap

    def nearest(self, which: Indices, start: Array, end: Array, beyond: Array) -> Nearest:
        """How near segments (3, k) are to shapes (k,), up to some distances (k,)."""
        axes = self.rotation[which].transpose(1, 2, 0)
        middle, half = self.middle[which].T, self.half[:, which]
        a, b = (np.einsum("ijk,jk->ik", axes, x) - middle for x in (start, end))
        found = segment_to_box(a, b, half, beyond)
        of = np.flatnonzero(which >= self.boxes)
        if len(of):
            radius, _, height = half[:, of]
            round_ones = segment_to_convex(
                a[:, of],
                b[:, of],
                lambda x, left: signed_cylinder(x, radius[left], height[left]),
                beyond[of],
            )
            found.put(of, round_ones)
        normal = np.einsum("ijk,ik->jk", axes, found.normal)
        return Nearest(found.distance, normal, np.einsum("ijk,ik->jk", axes, found.point + middle))


@dataclass(frozen=True, eq=False)
class Solids:
    """The shapes of a cell as arrays, and the pairs of shapes that are looked at.

    Pairs are in the order of the kind of the second shape: capsules, what stands, planes. The first
    one is a capsule of a body that moves.

    Attributes:
        carriers: Joints (K,) that move the capsules; -1 for those that stand still.
        start: One end (K, 3) of each, in the frame of its carrier [m].
        end: The other end (K, 3).
        radius: Their radii (K,).
        anchors: Points (K, 3) from which they hang, in the frame of the carrier; NaN for capsules
            that the carrier turns. The ends of what hangs are given from there on, in world axes.
        standing: Boxes, and cylinders.
        planes: Normals (S, 3) and offsets (S,) of half spaces.
        first: Index (P,) of the capsule of each pair.
        second: Index (P,) of the second shape among those of its kind.
        kinds: Where pairs of capsules, of what stands and of planes begin and end among all.
        bodies: Index (P,) of the pair of bodies that each belongs to.
        count: Number of pairs of bodies.
    """

    carriers: Indices
    start: Array
    end: Array
    radius: Array
    anchors: Array
    standing: _Standing
    planes: tuple[Array, Array]
    first: Indices
    second: Indices
    kinds: tuple[slice, ...]
    bodies: Indices
    count: int

    @classmethod
    def of(cls, cell: Cell) -> "Solids":
        """The shapes and pairs of a cell."""
        listed: dict[type[Shape], list[Shape]] = {kind: [] for kind in SHAPES}
        carriers: list[int] = []
        anchors: list[Array] = []
        at: dict[str, list[tuple[type[Shape], int]]] = {}
        for body in cell.bodies:
            at[body.name] = []
            for shape in body.shapes:
                own = listed[type(shape)]
                at[body.name].append((type(shape), len(own)))
                own.append(shape)
                if isinstance(shape, Capsule):
                    carriers.append(-1 if body.carrier is None else body.carrier)
                    anchors.append(np.full(3, np.nan) if body.hangs_at is None else body.hangs_at)
        standing = _Standing.of(
            [one for one in listed[Box] if isinstance(one, Box)],
            [one for one in listed[Cylinder] if isinstance(one, Cylinder)],
        )
        rows = _pairs_of_shapes(cell, at, standing.boxes)
        rows.sort(key=lambda row: row[0])
        table = np.array(rows, dtype=int).reshape(-1, 4)
        edges = np.searchsorted(table[:, 0], range(PLANES + 2))
        start, end, radius = capsule_arrays(
            one for one in listed[Capsule] if isinstance(one, Capsule)
        )
        planes = [one for one in listed[Plane] if isinstance(one, Plane)]
        return cls(
            carriers=np.array(carriers, dtype=int),
            start=start,
            end=end,
            radius=radius,
            anchors=np.array(anchors).reshape(-1, 3),
            standing=standing,
            planes=(
                np.array([one.normal for one in planes]).reshape(-1, 3),
                np.array([one.offset for one in planes]),
            ),
            first=table[:, 1],
            second=table[:, 2],
            kinds=tuple(slice(low, high) for low, high in pairwise(edges)),
            bodies=table[:, 3],
            count=len(cell.pairs),
        )

    def placed(self, frames: Frames) -> Placed:
        """Where the capsules are; frames have one axis of poses, and the bodies that are needed."""
        n = frames.position.shape[-1]
        start, end = np.empty((2, 3, len(self.carriers), n))
        for k, carrier in enumerate(self.carriers):
            if carrier < 0:
                start[:, k], end[:, k] = self.start[k][:, None], self.end[k][:, None]
                continue
            if self.hangs[k]:
                anchor = self.anchor(frames, k)
                start[:, k], end[:, k] = (x[k][:, None] + anchor for x in (self.start, self.end))
                continue
            rotation, origin = frames.bodies[int(carrier)]
            axes = rotation.reshape(3, -1)
            start[:, k] = (self.start[k] @ axes).reshape(3, n) + origin
            end[:, k] = (self.end[k] @ axes).reshape(3, n) + origin
        return Placed(start, end)

    @cached_property
    def hangs(self) -> Mask:
        """Which capsules (K,) hang from a point, and do not turn."""
        return ~np.isnan(self.anchors[:, 0])

    @cached_property
    def around(self) -> Array:
        """How far any point of a capsule is from its middle, at most (K,) [m]."""
        length = np.sqrt(np.square(self.end - self.start).sum(axis=1))
        return 0.5 * length + self.radius

    def anchor(self, frames: Frames, k: int) -> Array:
        """Where the point (3, N) is from which a capsule hangs [m]."""
        rotation, origin = frames.bodies[int(self.carriers[k])]
        axes = rotation.reshape(3, -1)
        return np.asarray((self.anchors[k] @ axes).reshape(3, -1) + origin)

    def bounds(self, placed: Placed) -> NDArray[np.float32]:
        """Lower bounds (P, N) on the distances of all pairs, by the middles of capsules [m].

        No point of a capsule is farther from its middle than half its length and its radius. Single
        precision takes half of the time. With the lengths up to L and the unit roundoff u, a
        component of a point in the axes of a shape is off by less than ``8 u L``, and what follows
        by less than ``ROUNDINGS u L`` in all, which the bounds leave.
        """
        middle = (0.5 * (placed.start + placed.end)).astype(np.float32)
        around = self.around.astype(np.float32)
        found = np.empty((len(self.first), middle.shape[-1]), np.float32)
        capsules, standing, planes = self.kinds
        apart = middle[:, self.first[capsules]] - middle[:, self.second[capsules]]
        apart *= apart
        np.sqrt(apart[0] + apart[1] + apart[2], out=found[capsules])
        found[capsules] -= around[self.second[capsules]][:, None]
        if standing.start < standing.stop:
            grid = self.standing.of_points(middle)
            found[standing] = grid[self.second[standing], self.first[standing]]
        if planes.start < planes.stop:
            normals, offsets = (one.astype(np.float32) for one in self.planes)
            heights = np.einsum("sc,ckn->skn", normals, middle) - offsets[:, None, None]
            found[planes] = heights[self.second[planes], self.first[planes]]
        rounding = ROUNDINGS * UNIT * (self._lengths + float(np.abs(middle).max(initial=0.0)))
        found -= (around + np.float32(rounding))[self.first][:, None]
        return found

    @cached_property
    def _lengths(self) -> float:
        """A bound on the lengths in a bound, beside those of the middles of capsules [m]."""
        standing = self.standing
        sizes = (standing.middle, standing.half, self.planes[1], self.around)
        return float(sum(np.abs(one).max(initial=0.0) for one in sizes))

    def exactly(
        self, placed: Placed, pair: Indices, pose: Indices, beyond: Array | float = np.inf
    ) -> Near:
        """How near some pairs (k,) are in poses (k,); those beyond a distance have any above it."""
        order = np.argsort(pair, kind="stable")
        beyond = np.broadcast_to(beyond, pair.shape)[order]
        pair, pose = pair[order], pose[order]
        edges = np.searchsorted(pair, [part.start for part in self.kinds] + [len(self.first)])
        found = [
            self._of_kind(kind, placed, pair[low:high], pose[low:high], beyond[low:high])
            for kind, (low, high) in enumerate(pairwise(edges))
            if low < high
        ]
        if not found:
            return Near(pair, pose, Nearest(np.zeros(0), np.zeros((3, 0)), np.zeros((3, 0))))
        distance = np.concatenate([one.distance for one in found]) - self.radius[self.first[pair]]
        normal = np.concatenate([one.normal for one in found], axis=1)
        point = np.concatenate([one.point for one in found], axis=1)
        return Near(pair, pose, Nearest(distance, normal, point))

    def _of_kind(
        self, kind: int, placed: Placed, pair: Indices, pose: Indices, beyond: Array
    ) -> Nearest:
        """How near the middle lines of capsules are to shapes of one kind."""
        first, second = self.first[pair], self.second[pair]
        a, b = placed.start[:, first, pose], placed.end[:, first, pose]
        if kind == CAPSULES:
            c, d = placed.start[:, second, pose], placed.end[:, second, pose]
            lines = segment_to_segment(a, b, c, d)
            return replace(lines, distance=lines.distance - self.radius[second])
        if kind == PLANES:
            normals, offsets = self.planes
            return segment_to_plane(a, b, normals[second].T, offsets[second])
        beyond = beyond + self.radius[first]
        return self.standing.nearest(second, a, b, beyond)

    def near(self, placed: Placed, within: Array | float) -> Near:
        """The pairs that are nearer than a distance, one for all poses or one a pose (N,)."""
        within = np.broadcast_to(within, placed.start.shape[-1:])
        return self._below(placed, self.bounds(placed), within)

    def _below(self, placed: Placed, bounds: NDArray[np.float32], within: Array) -> Near:
        """The pairs that are nearer than distances (N,), of those whose lower bounds are."""
        pair, pose = np.nonzero(bounds < within)
        found = self.exactly(placed, pair, pose, within[pose])
        return found.some(np.flatnonzero(found.nearest.distance < within[found.pose]))

    def nearest(self, placed: Placed) -> Near:
        """The nearest pair of each pose, in the order of poses; none without any pair.

        That of the least lower bound is measured first, then those whose bound is below it.
        """
        bounds = self.bounds(placed)
        every = np.arange(bounds.shape[1] if len(bounds) else 0)
        best = bounds.argmin(axis=0) if len(every) else every
        first = self.exactly(placed, best, every)
        least = np.full(bounds.shape[1], np.inf)
        least[first.pose] = first.nearest.distance
        bounds[first.pair, first.pose] = np.inf
        both = first.beside(self._below(placed, bounds, least))
        order = np.lexsort((both.nearest.distance, both.pose))
        return both.some(order[np.unique(both.pose[order], return_index=True)[1]])

    def all_distances(self, placed: Placed) -> Array:
        """Distances (N, pairs of bodies)."""
        n = placed.start.shape[-1]
        count = len(self.first)
        pair, pose = (one.ravel() for one in np.indices((count, n)))
        near = self.exactly(placed, pair, pose)
        found = np.full((n, self.count), np.inf)
        np.minimum.at(found, (near.pose, self.bodies[near.pair]), near.nearest.distance)
        return found

    def slopes(self, frames: Frames, near: Near) -> Array:
        """Derivatives (n, k) of the distances of some pairs by the free joints."""
        normal = near.nearest.normal
        axes, origins = frames.axes[..., near.pose], frames.origins[..., near.pose]
        joints = np.arange(len(axes))[:, None]
        parting = np.zeros((len(axes), len(near.pair)))
        capsules = near.pair < self.kinds[0].stop
        second = np.where(capsules, self.second[near.pair], -1)
        for sign, which in ((1.0, self.first[near.pair]), (-1.0, second)):
            velocity = cross(axes, self._carried(frames, near, which) - origins)
            velocity[frames.prismatic] = axes[frames.prismatic]
            carrier = np.where(which < 0, -1, self.carriers[which])
            parting += sign * (joints <= carrier) * np.einsum("jck,ck->jk", velocity, normal)
        return frames.folded(parting)

    def _carried(self, frames: Frames, near: Near, which: Indices) -> Array:
        """The points (3, k) that move as the nearest points on some capsules (k,) do.

        Of what hangs it is the point from which it hangs; -1 stands for what is no capsule.
        """
        if not self.hangs.any():
            return near.nearest.point
        point = near.nearest.point.copy()
        for k in np.flatnonzero(self.hangs):
            rows = np.flatnonzero(which == k)
            point[:, rows] = self.anchor(frames, int(k))[:, near.pose[rows]]
        return point


SHAPES: tuple[type[Shape], ...] = (Capsule, Box, Cylinder, Plane)
CAPSULES, STANDING, PLANES = range(3)  # kinds, in the order of `Solids.kinds`


def _pairs_of_shapes(
    cell: Cell, at: Mapping[str, list[tuple[type[Shape], int]]], boxes: int
) -> list[tuple[int, int, int, int]]:
    """Kind of the second shape, indices of both, and the pair of bodies, of each pair of shapes.

    Of what stands, boxes come first.
    """
    kinds = {Capsule: (CAPSULES, 0), Plane: (PLANES, 0)}
    kinds |= {Box: (STANDING, 0), Cylinder: (STANDING, boxes)}
    moves = {body.name: body.carrier is not None for body in cell.bodies}
    found = []
    for index, pair in enumerate(cell.pairs):
        # The first one moves, and is of capsules.
        one, other = pair if moves[pair[0]] else pair[::-1]
        for _, first in at[one]:
            for shape, second in at[other]:
                kind, before = kinds[shape]
                found.append((kind, first, before + second, index))
    return found


def chunks(n: int) -> list[slice]:
    """Parts of n poses that are looked at together."""
    return [slice(low, min(low + CHUNK, n)) for low in range(0, n, CHUNK)]


def signed_point(shape: Shape, point: Array) -> float:
    """Signed distance of a point (3,) to a solid [m]: negative inside."""
    if isinstance(shape, Plane):
        return float(shape.normal @ point - shape.offset)
    if isinstance(shape, Capsule):
        way = shape.end - shape.start
        share = np.clip(way @ (point - shape.start) / max(float(way @ way), TINY), 0.0, 1.0)
        return float(np.linalg.norm(point - shape.start - share * way) - shape.radius)
    local = shape.pose[:3, :3].T @ (point - shape.pose[:3, 3])
    if isinstance(shape, Box):
        return float(signed_box(local, shape.half)[0])
    return float(signed_cylinder(local, np.array(shape.radius), np.array(shape.half_height))[0])


def standing_at(bodies: Sequence[Body], point: Array) -> tuple[str, float] | None:
    """The standing body in which a point (3,) is, and how deep [m]; None where it is in none."""
    standing = [body for body in bodies if body.carrier is None]
    deep = [(min(signed_point(one, point) for one in body.shapes), body.name) for body in standing]
    least, name = min(deep, default=(0.0, ""))
    return (name, -least) if least < 0 else None


@dataclass(frozen=True, eq=False)
class Clear(Constraint):
    """Nothing in the cell touches: a smooth slack, which is positive in free poses alone.

    With the clearances c_i of pairs of shapes, ``x_i = (D - c_i)/b`` where it is positive, and
    ``w(x) = e^x - 1 - x - x^2/2``, the slack is

        D - b log(1 + a sum_i w(x_i)),  a = (e^(D/b) - 1) / w(D/b).

    Pairs at a distance beyond D do not count, and need no distance but a lower bound; where they
    come near, two derivatives are continuous. Of one pair the slack is zero where its clearance is.
    Of k pairs that are equally near it is zero at a clearance of b log k at most: a millimetre or
    ten before they touch, and never behind.

    Attributes:
        cell: The cell.
        reach: D [m].
        blur: b [m].
    """

    cell: Cell
    reach: float = REACH
    blur: float = BLUR

    def inequalities(self, robot: Robot) -> tuple[Inequality, ...]:
        """The one bound [mm]."""
        margin = self.cell.margin * MILLIMETRE.per_si
        return (Inequality(f"clearance in the cell > {margin:g} mm", MILLIMETRE),)

    def slack(self, frames: Frames) -> Array:
        """The slack (1, ...) [m]."""
        known = _known.get(frames, {})
        return known[self][0] if self in known else self._look(frames, slopes=False)[0]

    def gradient(self, frames: Frames) -> Array:
        """Its derivative (1, n, ...); the slack of these frames is known then, too."""
        known = _known.setdefault(frames, {})
        if self not in known:
            known[self] = self._look(frames, slopes=True)
        return known[self][1]

    def _look(self, frames: Frames, slopes: bool) -> tuple[Array, Array]:
        """Slack and derivative in poses (...); zeros where no slopes are asked for."""
        n, batch = len(frames.q), frames.q.shape[1:]
        count = frames.position[0].size
        slack = np.empty(count)
        gradient = np.zeros((n, count))
        cell = self.cell
        for part in chunks(count):
            some = cell.robot.frames_of(frames, cell.carriers, np.arange(count)[part])
            slack[part], share, near = self._of_poses(some)
            if slopes:
                by_joint = share * cell.solids.slopes(some, near)
                gradient[:, part] = [
                    np.bincount(near.pose, row, len(some.q[0])) for row in by_joint
                ]
        return slack.reshape(1, *batch), gradient.reshape(1, n, *batch)

    def _of_poses(self, frames: Frames) -> tuple[Array, Array, Near]:
        """Slacks (N,) of poses, and by how much each of their near pairs (k,) counts in them."""
        solids = self.cell.solids
        count = frames.position.shape[1]
        near = solids.near(solids.placed(frames), self.reach + self.cell.margin)
        clearance = near.nearest.distance - self.cell.margin
        slack, share = smooth_least(clearance, near.pose, count, self.reach, self.blur)
        return slack, share, near


def smooth_least(
    clearance: Array, of: Indices, count: int, reach: float = REACH, blur: float = BLUR
) -> tuple[Array, Array]:
    """Smooth slacks of clearances, see `Clear`.

    Args:
        clearance: Clearances c_i (k,) below the reach [m].
        of: To which of the slacks each belongs (k,).
        count: Number of slacks.
        reach: D, which is the slack of no clearance [m].
        blur: b [m].

    Returns:
        The slacks (count,) [m], and their derivatives (k,) by the clearances.
    """
    x = (reach - clearance) / blur
    # Exponentials are taken relative to the largest of a slack, as deep ones would overflow.
    top = np.zeros(count)
    np.maximum.at(top, of, x)
    at_zero = reach / blur
    scale = np.expm1(at_zero) / _weight(at_zero, 0.0)
    own = top[of]
    total = np.exp(-top) + scale * np.bincount(of, _weight(x, own), count)
    slack = reach - blur * (np.log(total) + top)
    return slack, scale * _weight_slope(x, own) / total[of]


def _weight(x: Array | float, top: Array | float) -> Array:
    """``(e^x - 1 - x - x^2/2) e^-top``; by its series where x is small."""
    x = np.asarray(x)
    small = x**3 / 6 * (1 + x / 4 * (1 + x / 5 * (1 + x / 6)))
    whole = np.exp(x - top) - (1 + x + x**2 / 2) * np.exp(-top)
    return np.where(x < SMALL, small * np.exp(-top), whole)


def _weight_slope(x: Array, top: Array) -> Array:
    """Its derivative by x, ``(e^x - 1 - x) e^-top``."""
    small = x**2 / 2 * (1 + x / 3 * (1 + x / 4 * (1 + x / 5)))
    whole = np.exp(x - top) - (1 + x) * np.exp(-top)
    return np.where(x < SMALL, small * np.exp(-top), whole)


SMALL = 0.05  # where four terms of the series leave 1e-8, and e^x loses as many digits
# What is known of frames that are still in use, by the constraint that asked.
_known: WeakKeyDictionary[Frames, dict[Clear, tuple[Array, Array]]] = WeakKeyDictionary()
