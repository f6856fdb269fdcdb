"""Solids, and the bodies that they make up: an arm's parts, its load, what stands around it.

All lengths are metres. A shape is given in the frame of its body's carrier:

- of a body that stands still, the world's;
- of one that a joint moves, the frame of that joint as `Frames.bodies` gives it, which turns and
  slides with the joint. It is the frame of a URDF's link, and that of `center_m` in a robot's file.
  A tool is carried by the last joint too, so its shapes are given after that joint, not after the
  flange;
- of one that hangs from a point of the arm, this point, with the axes of the world: the body moves
  as the point does, and does not turn.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from edtk.system.typing import Array, Indices

Source = Literal["URDF", "typed", "default"]


@dataclass(frozen=True, eq=False)
class Capsule:
    """All points within a radius of a segment; a ball where both ends are one point.

    Attributes:
        start: One end (3,) of the segment [m].
        end: The other end (3,) [m].
        radius: The radius [m].
    """

    start: Array
    end: Array
    radius: float

    def __post_init__(self) -> None:
        _require_positive("radius", self.radius)

    @property
    def length(self) -> float:
        """Length of the segment [m]."""
        return float(np.linalg.norm(self.end - self.start))

    def moved(self, T: Array) -> "Capsule":
        """The same capsule where a transform (4, 4) brings it [m]."""
        return replace(self, start=_moved(T, self.start), end=_moved(T, self.end))


@dataclass(frozen=True, eq=False)
class Box:
    """A cuboid.

    Attributes:
        pose: Transform (4, 4) of the frame in its middle, along its edges [m].
        half: Half of each edge (3,) [m].
    """

    pose: Array
    half: Array

    def __post_init__(self) -> None:
        _require_positive("size", float(np.min(self.half)))

    def moved(self, T: Array) -> "Box":
        """The same box where a transform (4, 4) brings it [m]."""
        return replace(self, pose=T @ self.pose)


@dataclass(frozen=True, eq=False)
class Cylinder:
    """A cylinder with flat ends.

    Attributes:
        pose: Transform (4, 4) of the frame in its middle, whose z-axis is the cylinder's [m].
        radius: The radius [m].
        half_height: Half of its height [m].
    """

    pose: Array
    radius: float
    half_height: float

    def __post_init__(self) -> None:
        _require_positive("radius", self.radius)
        _require_positive("height", self.half_height)

    def moved(self, T: Array) -> "Cylinder":
        """The same cylinder where a transform (4, 4) brings it [m]."""
        return replace(self, pose=T @ self.pose)


@dataclass(frozen=True, eq=False)
class Plane:
    """A half space: all points x with ``normal . x <= offset``, as the ground below a floor.

    Attributes:
        normal: Unit vector (3,) out of the solid.
        offset: How far the plane is from the origin, along the normal [m].
    """

    normal: Array
    offset: float

    def __post_init__(self) -> None:
        length = float(np.linalg.norm(self.normal))
        _require_positive("length of the normal", length)
        object.__setattr__(self, "normal", np.asarray(self.normal, dtype=float) / length)

    def moved(self, T: Array) -> "Plane":
        """The same half space where a transform (4, 4) brings it [m]."""
        normal = T[:3, :3] @ self.normal
        return Plane(normal, float(self.offset + normal @ T[:3, 3]))


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, as a drawing has them. They are for pictures and for a check by other programs.

    Distances are never taken of a mesh, but of convex shapes that contain it, see `Body.shapes`.

    Attributes:
        vertices: Points (v, 3) [m].
        faces: Indices (f, 3) of the points of each triangle.
    """

    vertices: Array
    faces: Indices

    @property
    def triangles(self) -> Array:
        """Corners (f, 3, 3) of the triangles [m]."""
        return self.vertices[self.faces]

    def moved(self, T: Array) -> "Mesh":
        """The same triangles where a transform (4, 4) brings them [m]."""
        return replace(self, vertices=_moved(T, self.vertices))


Shape = Capsule | Box | Cylinder | Plane


@dataclass(frozen=True, eq=False)
class Body:
    """A named part of the cell: the union of its shapes, all of which are convex.

    Attributes:
        name: Name for people, one of its own in a cell.
        carrier: Index of the joint that moves the body, as `Robot.body_names` counts; None for a
            body that stands still. What moves is made of capsules alone.
        shapes: What the body is within; distances are those of these shapes.
        source: From where the shapes are: a URDF, typed by a person, or a default of a robot that
            ships with edtk.
        meshes: The triangles that the shapes contain, where there are any.
        hangs_at: The point (3,) of its carrier from which a weight hangs [m]; None for a body that
            its carrier turns.
    """

    name: str
    carrier: int | None
    shapes: tuple[Shape, ...]
    source: Source = "typed"
    meshes: tuple[Mesh, ...] = ()
    hangs_at: Array | None = None

    def __post_init__(self) -> None:
        if not self.shapes:
            raise ValueError(f"body {self.name}: has no shape; expected at least one")
        if self.carrier is not None and len(self.capsules) < len(self.shapes):
            raise ValueError(f"body {self.name}: moves, and is not made of capsules alone")
        if self.carrier is None and self.hangs_at is not None:
            raise ValueError(
                f"body {self.name}: hangs from nothing; expected a joint that moves it"
            )

    @property
    def capsules(self) -> tuple[Capsule, ...]:
        """Those of the shapes that are capsules: all, of a body that moves."""
        return tuple(shape for shape in self.shapes if isinstance(shape, Capsule))

    def moved(self, T: Array) -> "Body":
        """The same body where a transform (4, 4) in its carrier's frame brings it [m]."""
        shapes = tuple(shape.moved(T) for shape in self.shapes)
        return replace(self, shapes=shapes, meshes=tuple(mesh.moved(T) for mesh in self.meshes))


def capsule_arrays(capsules: Iterable[Capsule]) -> tuple[Array, Array, Array]:
    """Starts (k, 3), ends (k, 3) and radii (k,) of capsules [m]."""
    found = tuple(capsules)
    starts = np.array([one.start for one in found], dtype=float).reshape(-1, 3)
    ends = np.array([one.end for one in found], dtype=float).reshape(-1, 3)
    return starts, ends, np.array([one.radius for one in found], dtype=float)


def _moved(T: Array, points: Array) -> Array:
    """Points (..., 3) where a transform (4, 4) brings them."""
    return np.asarray(points @ T[:3, :3].T + T[:3, 3])


def _require_positive(what: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0):
        raise ValueError(f"{what} is {value:g}; expected a positive number")
