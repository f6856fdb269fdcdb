"""Beams between eyes and markers: how far they are from all bodies of a cell."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from edtk.cell.cell import Cell, Placed
from edtk.cell.distance import Nearest, dot, segment_to_plane, segment_to_segment
from edtk.cell.shapes import Box, Capsule, Cylinder, Plane
from edtk.robots.frames import BodyPoint, Frames, cross
from edtk.system.typing import Array, Indices

REACH = 0.05  # a body that is farther from a beam counts as this far [m]
NOTHING = -1  # index of the body that is near, where none is


class Passing(NamedTuple):
    """How near a beam passes bodies, in poses (N,).

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

    def some(self, poses: Indices) -> "Passing":
        """In some of the poses."""
        of_each = (self.normal[:, poses], self.point[:, poses])
        return Passing(self.distance[poses], self.body[poses], *of_each)


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

    def passing(self, frames: Frames, eye: Array, marker: BodyPoint) -> Passing:
        """How near the beams from an eye (3,) to a marker pass, in poses with one axis."""
        p = marker.position(frames)
        start = np.broadcast_to(eye[:, None], p.shape)
        way = p - start
        length = np.maximum(np.sqrt(dot(way, way)), np.finfo(float).tiny)
        short = start + way * np.maximum(1 - self.own / length, 0.0)
        carrier = len(frames.axes) - 1 if marker.joint is None else marker.joint
        n = p.shape[-1]
        best = Passing(np.full(n, REACH), np.full(n, NOTHING), np.zeros((3, n)), np.zeros((3, n)))
        placed = self.cell.solids.placed(frames)
        for own_body, end in ((False, p), (True, short)):
            bodies = np.flatnonzero((self.carriers == carrier) == own_body)
            self._pass_capsules(best, placed, bodies, start, end)
            if not own_body:  # what stands still carries no marker of the robot
                self._pass_standing(best, start, end)
        return best._replace(distance=best.distance - self.radius)

    def _pass_capsules(
        self, best: Passing, placed: Placed, bodies: Indices, start: Array, end: Array
    ) -> None:
        """Lessen distances by those of the capsules of some bodies."""
        solids, owner = self.cell.solids, self.owners[Capsule]
        for k in np.flatnonzero(np.isin(owner, bodies)):
            a, b = placed.start[:, k], placed.end[:, k]
            middle = 0.5 * (a + b)
            far = segment_to_segment(middle, middle, start, end).distance - solids.around[k]
            near = np.flatnonzero(far < best.distance)
            found = segment_to_segment(start[:, near], end[:, near], a[:, near], b[:, near])
            _keep(best, near, found, solids.radius[k], owner[k])

    def _pass_standing(self, best: Passing, start: Array, end: Array) -> None:
        """Lessen distances by those of boxes, cylinders and planes."""
        solids = self.cell.solids
        for kind, standing in zip((Box, Cylinder), solids.standing, strict=True):
            for s, owner in enumerate(self.owners[kind]):
                which = np.full(start.shape[1], s)
                found = standing.nearest(which, start, end, best.distance)
                _keep(best, np.arange(len(which)), found, 0.0, owner)
        for s, owner in enumerate(self.owners[Plane]):
            normal, offset = solids.planes[0][s][:, None], solids.planes[1][s]
            found = segment_to_plane(start, end, normal, offset)
            _keep(best, np.arange(start.shape[1]), found, 0.0, owner)

    def slopes(self, frames: Frames, eye: Array, marker: BodyPoint, near: Passing) -> Array:
        """Derivatives (n, N) of the distances by the free joints.

        A point of the beam at the share t of its length, ``x = e + t (p - e)``, moves by t times
        the marker's motion v; one at a fixed distance from the marker moves along the beam with it,
        by ``t v + (1 - t) u u.v``. Both are the same across the beam, along which the distance
        changes at the marker's end alone. The body's point moves as the beam's would on it.
        """
        p = marker.position(frames)
        way = p - eye[:, None]
        length = np.sqrt(dot(way, way))
        u = way / length
        share = dot(near.point - eye[:, None], u) / length
        v = marker.linear(frames)
        along = np.einsum("jcN,cN->jN", v, u)
        moved = share * v + ((1 - share) * along)[:, None] * u
        turned = cross(frames.axes, self._carried(frames, near) - frames.origins)
        turned[frames.prismatic] = frames.axes[frames.prismatic]
        carrier = np.where(near.body == NOTHING, -1, self.carriers[near.body])
        carried = np.arange(len(frames.axes))[:, None] <= carrier
        by_beam = np.einsum("jcN,cN->jN", moved, near.normal)
        by_body = np.einsum("jcN,cN->jN", turned, near.normal) * carried
        return np.asarray(frames.folded(by_beam - by_body))

    def _carried(self, frames: Frames, near: Passing) -> Array:
        """Points (3, N) that move as those of the bodies do: of what hangs, that it hangs from."""
        point = near.point.copy()
        for index, body in enumerate(self.cell.bodies):
            if body.hangs_at is not None:
                some = np.flatnonzero(near.body == index)
                anchor = BodyPoint(body.hangs_at, body.carrier).position(frames)
                point[:, some] = anchor[:, some]
        return point


def _keep(best: Passing, poses: Indices, found: Nearest, radius: float, body: int) -> None:
    """Take what is nearer than the best so far, in some poses."""
    distance = found.distance - radius
    nearer = distance < best.distance[poses]
    which = poses[nearer]
    best.distance[which] = distance[nearer]
    best.body[which] = body
    best.normal[:, which] = found.normal[:, nearer]
    best.point[:, which] = found.point[:, nearer]
