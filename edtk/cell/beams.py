"""Beams between eyes and markers: how far they are from all bodies of a cell."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from edtk.cell.cell import Cell, Placed
from edtk.cell.distance import Nearest, dot, segment_to_plane, segment_to_segment
from edtk.cell.shapes import Box, Capsule, Cylinder, Plane
from edtk.robots.frames import BodyPoint, Frames, cross
from edtk.system.typing import Array, Indices, Mask

REACH = 0.05  # a body that is farther from a beam counts as this far [m]
NOTHING = -1  # index of the body that is near, where none is


class Passing(NamedTuple):
    """How near beams pass bodies (N,).

    Attributes:
        distance: Least distance from any body, `REACH` at most, less the beam's radius [m].
        body: Index of the body in `Cell.bodies`; -1 where none is near.
        normal: Unit vectors (3, N) from the body to the beam.
        point: Nearest points (3, N) of the beam [m].
    """

    distance: Array
    body: Indices
    normal: Array
    point: Array

    def some(self, view: Indices, pose: Indices) -> "Passing":
        """Of some views in some poses (k,), where each array has both axes."""
        of_each = (self.normal[:, view, pose], self.point[:, view, pose])
        return Passing(self.distance[view, pose], self.body[view, pose], *of_each)


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
        """How near beams pass, of `asked` views (b, N) in poses with one axis, as nonzero has them.

        Lower bounds leave most pairs of a beam and a shape out. Capsules come first, and what
        stands is asked for within what they leave.

        Args:
            frames: The poses (N,), with the bodies of the cell and of the markers.
            views: Eyes (3,) and the markers that they look at.
            asked: Which views count in which poses.
        """
        view, pose = np.nonzero(asked)
        start = np.array([eye for eye, _ in views])[view].T
        ends = np.array([marker.position(frames) for _, marker in views])
        way = ends[view, :, pose].T - start
        moved = _movers(frames, views)
        n = len(view)
        best = Passing(np.full(n, REACH), np.full(n, NOTHING), np.zeros((3, n)), np.zeros((3, n)))
        self._pass_capsules(best, self.cell.solids.placed(frames), pose, moved[view], start, way)
        self._pass_standing(best, start, start + way)  # what stands still carries no marker
        return best._replace(distance=best.distance - self.radius)

    def _pass_capsules(
        self,
        best: Passing,
        placed: Placed,
        pose: Indices,
        carrier: Indices,
        start: Array,
        way: Array,
    ) -> None:
        """Lessen distances by those of capsules: of the marker's own body up to `own` before it.

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
        k, beam = np.nonzero(bound < best.distance)
        a, at = start[:, beam], pose[beam]
        b = a + until[k, beam] * way[:, beam]
        found = segment_to_segment(a, b, placed.start[:, k, at], placed.end[:, k, at])
        _keep(best, beam, found, solids.radius[k], owner[k])

    def _pass_standing(self, best: Passing, start: Array, end: Array) -> None:
        """Lessen distances by those of boxes, cylinders and planes."""
        solids = self.cell.solids
        owner = np.concatenate([self.owners[Box], self.owners[Cylinder]])
        s, beam = np.nonzero(solids.standing.below(start, end) < best.distance)
        if len(s):
            found = solids.standing.nearest(s, start[:, beam], end[:, beam], best.distance[beam])
            _keep(best, beam, found, 0.0, owner[s])
        every = np.arange(start.shape[1])
        for plane, owner in enumerate(self.owners[Plane]):
            normal, offset = solids.planes[0][plane][:, None], solids.planes[1][plane]
            found = segment_to_plane(start, end, normal, offset)
            _keep(best, every, found, 0.0, np.full(len(every), owner))

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
            near: How near beams (k,) pass a body each.
            view: Whose beam each is (k,).
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
        carrier = np.where(near.body == NOTHING, -1, self.carriers[near.body])
        moved -= velocity(self._carried(frames, near, pose), carrier)
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


def _keep(
    best: Passing, beam: Indices, found: Nearest, radius: Array | float, body: Indices
) -> None:
    """Take the nearest of what is found of each beam, where it is nearer than the best so far."""
    distance = found.distance - radius
    order = np.lexsort((distance, beam))
    order = order[np.unique(beam[order], return_index=True)[1]]
    nearer = order[distance[order] < best.distance[beam[order]]]
    which = beam[nearer]
    best.distance[which] = distance[nearer]
    best.body[which] = body[nearer]
    best.normal[:, which] = found.normal[:, nearer]
    best.point[:, which] = found.point[:, nearer]
