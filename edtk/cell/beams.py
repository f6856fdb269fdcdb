"""Beams between eyes and markers: how far they are from all bodies of a cell."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from edtk.cell.cell import REACH, Cell, Placed
from edtk.cell.distance import dot, segment_to_plane, segment_to_segment
from edtk.cell.shapes import Box, Capsule, Cylinder, Plane
from edtk.robots.frames import BodyPoint, Frames, cross
from edtk.system.typing import Array, Indices, Mask


class Passing(NamedTuple):
    """Shapes that beams pass at less than `REACH` (k,).

    Attributes:
        beam: Whose beam it is: index among those that were asked for.
        body: Index of the shape's body in `Cell.bodies`.
        distance: Distance of the shape, less the beam's radius [m].
        normal: Unit vectors (3, k) from the shape to the beam.
        point: Nearest points (3, k) of the beam [m].
    """

    beam: Indices
    body: Indices
    distance: Array
    normal: Array
    point: Array

    @classmethod
    def joined(cls, parts: Sequence["Passing"]) -> "Passing":
        """Several of them, one after another."""
        return cls(*(np.concatenate(arrays, axis=-1) for arrays in zip(*parts, strict=True)))

    def some(self, chosen: Mask) -> "Passing":
        """Some of them."""
        sides = (self.normal[:, chosen], self.point[:, chosen])
        return Passing(self.beam[chosen], self.body[chosen], self.distance[chosen], *sides)


NOTHING = Passing(
    np.zeros(0, dtype=int), np.zeros(0, dtype=int), np.zeros(0), np.zeros((3, 0)), np.zeros((3, 0))
)


@dataclass(frozen=True, eq=False)
class Beams:
    """Straight beams that no body of a cell may cross.

    Attributes:
        cell: The bodies.
        radius: Radius of a beam [m].
        own: The last part of a beam, which the body that carries the marker does not hide [m].
    """

    cell: Cell
    radius: float
    own: float

    @cached_property
    def owners(self) -> dict[type, Indices]:
        """Index of the body of each shape, by kind, in the order of `Solids`."""
        found: dict[type, list[int]] = {Capsule: [], Box: [], Cylinder: [], Plane: []}
        for index, body in enumerate(self.cell.bodies):
            for shape in body.shapes:
                found[type(shape)].append(index)
        return {kind: np.array(own, dtype=int) for kind, own in found.items()}

    @cached_property
    def carriers(self) -> Indices:
        """Joint that moves each body; -1 for those that stand still."""
        every = (body.carrier for body in self.cell.bodies)
        return np.array([-1 if joint is None else joint for joint in every], dtype=int)

    def passing(
        self, frames: Frames, views: Sequence[tuple[Array, BodyPoint]], asked: Mask
    ) -> Passing:
        """What is near the beams of `asked` views (b, N) in poses with one axis.

        Beams are counted as `np.nonzero` has those that are asked for. Lower bounds leave most
        pairs of a beam and a shape out.

        Args:
            frames: The poses (N,), with the bodies of the cell and of the markers.
            views: Eyes (3,) and the markers that they look at.
            asked: Which views count in which poses.
        """
        view, pose = np.nonzero(asked)
        start = np.array([eye for eye, _ in views])[view].T
        ends = np.array([marker.position(frames) for _, marker in views])
        way = ends[view, :, pose].T - start
        moved = _movers(frames, views)[view]
        capsules = self._near_capsules(self.cell.solids.placed(frames), pose, moved, start, way)
        # What stands still carries no marker.
        found = Passing.joined([capsules, *self._near_standing(start, start + way)])
        found = found._replace(distance=found.distance - self.radius)
        return found.some(found.distance < REACH)

    def _near_capsules(
        self, placed: Placed, pose: Indices, carrier: Indices, start: Array, way: Array
    ) -> Passing:
        """The capsules near beams: of the marker's own body up to `own` before it.

        The lower bound is the distance of the capsule's middle, less all that is around it.
        """
        solids, owner = self.cell.solids, self.owners[Capsule]
        squared = np.maximum(dot(way, way), np.finfo(float).tiny)
        free = np.maximum(1 - self.own / np.sqrt(squared), 0.0)
        until = np.where(self.carriers[owner][:, None] == carrier, free, 1.0)
        middle = 0.5 * (placed.start + placed.end)
        apart = middle[:, :, pose] - start[:, None]
        share = np.clip(np.einsum("ckn,cn->kn", apart, way) / squared, 0.0, until)
        apart -= share * way[:, None]
        bound = np.sqrt(np.einsum("ckn,ckn->kn", apart, apart)) - solids.around[:, None]
        k, beam = np.nonzero(bound < REACH + self.radius)
        a, at = start[:, beam], pose[beam]
        b = a + until[k, beam] * way[:, beam]
        found = segment_to_segment(a, b, placed.start[:, k, at], placed.end[:, k, at])
        distance = found.distance - solids.radius[k]
        return Passing(beam, owner[k], distance, found.normal, found.point)

    def _near_standing(self, start: Array, end: Array) -> list[Passing]:
        """The boxes, cylinders and planes near beams."""
        solids = self.cell.solids
        within = REACH + self.radius
        owner = np.concatenate([self.owners[Box], self.owners[Cylinder]])
        s, beam = np.nonzero(solids.standing.below(start, end) < within)
        parts = []
        if len(s):
            beyond = np.full(len(s), within)
            found = solids.standing.nearest(s, start[:, beam], end[:, beam], beyond)
            parts.append(Passing(beam, owner[s], found.distance, found.normal, found.point))
        every = np.arange(start.shape[1])
        for plane, own in enumerate(self.owners[Plane]):
            normal, offset = solids.planes[0][plane][:, None], solids.planes[1][plane]
            found = segment_to_plane(start, end, normal, offset)
            body = np.full(len(every), own)
            parts.append(Passing(every, body, found.distance, found.normal, found.point))
        return parts

    def slopes(
        self,
        frames: Frames,
        views: Sequence[tuple[Array, BodyPoint]],
        near: Passing,
        view: Indices,
        pose: Indices,
    ) -> Array:
        """Derivatives (n, k) of the distances by the free joints.

        A point of the beam at the share t of its length, ``x = e + t (p - e)``, moves by t times
        the marker's motion v; one at a fixed distance from the marker moves along the beam with it,
        by ``t v + (1 - t) u u.v``. Both are the same across the beam, along which the distance
        changes at the marker's end alone. The body's point moves as the beam's would on it.

        Args:
            frames: The poses (N,), as `passing` has them.
            views: Eyes and markers (b,).
            near: What beams pass (k,).
            view: Whose beam each passes (k,).
            pose: In which pose (k,).
        """
        eye = np.array([eye for eye, _ in views])[view].T
        p = np.array([marker.position(frames) for _, marker in views])[view, :, pose].T
        way = p - eye
        length = np.sqrt(dot(way, way))
        u = way / length
        share = dot(near.point - eye, u) / length
        axes, origins = frames.axes[..., pose], frames.origins[..., pose]
        joints = np.arange(len(axes))[:, None]

        def velocity(point: Array, carrier: Indices) -> Array:
            """Velocities (N, 3, k) of points of bodies that joints carry."""
            of_each = cross(axes, point - origins)
            of_each[frames.prismatic] = axes[frames.prismatic]
            return of_each * (joints <= carrier)[:, None]

        v = velocity(p, _movers(frames, views)[view])
        along = np.einsum("jck,ck->jk", v, u)
        moved = share * v + ((1 - share) * along)[:, None] * u
        moved -= velocity(self._carried(frames, near, pose), self.carriers[near.body])
        return np.asarray(frames.folded(np.einsum("jck,ck->jk", moved, near.normal)))

    def _carried(self, frames: Frames, near: Passing, pose: Indices) -> Array:
        """Points (3, k) that move as those of the bodies do: of what hangs, that it hangs from."""
        point = near.point.copy()
        for index, body in enumerate(self.cell.bodies):
            if body.hangs_at is not None:
                some = np.flatnonzero(near.body == index)
                anchor = BodyPoint(body.hangs_at, body.carrier).position(frames)
                point[:, some] = anchor[:, pose[some]]
        return point


def _movers(frames: Frames, views: Sequence[tuple[Array, BodyPoint]]) -> Indices:
    """Joint that moves the marker of each view (b,): the last one of what is on the tool."""
    last = len(frames.axes) - 1
    return np.array([last if one.joint is None else one.joint for _, one in views])
