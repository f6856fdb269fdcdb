"""Tables of a study about the cell: what stands around the robot, what it carries, what hangs, and
what the instrument sees.
"""

from typing import Annotated

import numpy as np
from pydantic import Field, field_validator, model_validator
from pydantic_core import PydanticCustomError

from edtk.cell.meshes import Unit
from edtk.cell.shapes import Box, Capsule, Cylinder, Plane
from edtk.cell.sight import Eye, facing
from edtk.robots.frames import MILLIMETRE
from edtk.robots.rotations import transform
from edtk.system.fields import ZERO, Finite, Line, NotNegative, Positive, Table, Vector3
from edtk.system.typing import Array

Millimetres = Annotated[Finite, Field(ge=0.1)]  # of a size: a body has one
ACCEPTANCE = 30.0  # [deg] of a 1.5-inch spherically mounted reflector
Degrees = Annotated[Finite, Field(ge=-360, le=360)]
Opening = Annotated[Finite, Field(gt=0, le=360)]
FULL = 360.0


class PartTable(Table):
    """A named part of the cell. Parts of one name are one body."""

    name: Line = Field(description="Name of the body, for people; parts of one name are one body")
    joint: str | None = Field(
        None,
        description='The joint that carries it, in whose own frame it is then given; "tool" for '
        "the frame in which `tool.position_mm` is given; without one it stands in the world",
    )


class PlacedPart(PartTable):
    """A part that is placed and turned."""

    position_mm: Vector3 = Field(ZERO, description="Where its middle is [mm]")
    rpy_deg: Vector3 = Field(
        ZERO, description="Roll, pitch and yaw about the fixed axes x, y and z, in this order [deg]"
    )

    @property
    def pose(self) -> Array:
        """Transform (4, 4) [m]."""
        return transform(MILLIMETRE * np.array(self.position_mm), np.deg2rad(self.rpy_deg))


class BoxTable(PlacedPart):
    """A cuboid."""

    size_mm: tuple[Millimetres, Millimetres, Millimetres] = Field(
        description="Its edges along its own x, y and z [mm]"
    )

    def build(self) -> Box:
        """The box [m]."""
        return Box(self.pose, MILLIMETRE * np.array(self.size_mm) / 2)


class CylinderTable(PlacedPart):
    """A cylinder along its own z-axis."""

    radius_mm: Millimetres = Field(description="Radius [mm]")
    height_mm: Millimetres = Field(description="Height [mm]")

    def build(self) -> Cylinder:
        """The cylinder [m]."""
        return Cylinder(self.pose, MILLIMETRE * self.radius_mm, MILLIMETRE * self.height_mm / 2)


class CapsuleTable(PartTable):
    """All points within a radius of a segment."""

    from_mm: Vector3 = Field(description="One end of its middle line [mm]")
    to_mm: Vector3 = Field(description="The other end; the same one for a ball [mm]")
    radius_mm: Millimetres = Field(description="Radius [mm]")

    def build(self) -> Capsule:
        """The capsule [m]."""
        start, end = MILLIMETRE * np.array([self.from_mm, self.to_mm])
        return Capsule(start, end, MILLIMETRE * self.radius_mm)


class PlaneTable(Table):
    """A floor or a wall: all that is behind the plane is solid."""

    name: Line = Field(description="Name of the body, for people")
    normal: Vector3 = Field((0.0, 0.0, 1.0), description="Direction out of the solid [-]")
    position_mm: Vector3 = Field(ZERO, description="A point of the plane [mm]")

    @model_validator(mode="after")
    def _directed(self) -> "PlaneTable":
        if not np.any(self.normal):
            raise PydanticCustomError("normal", "normal: expected a direction, got zero")
        return self

    def build(self) -> Plane:
        """The half space [m]."""
        normal = np.array(self.normal) / np.linalg.norm(self.normal)
        return Plane(normal, float(MILLIMETRE * normal @ self.position_mm))


class MeshTable(PlacedPart):
    """A file of triangles, placed."""

    position_mm: Vector3 = Field(ZERO, description="Where the origin of the file is [mm]")
    file: Line = Field(description="STL, OBJ or COLLADA file, beside the study")
    unit: Unit = Field(
        "mm",
        description="What a 1 in the file stands for: 'mm', 'm' or 'inch'; COLLADA says its own",
    )


class HangingTable(Table):
    """A weight on a rope that hangs from the tool point, and swings."""

    name: Line = Field("load", description="Name of the weight, for people")
    rope_mm: NotNegative = Field(description="Length of the rope, down to the weight [mm]")
    radius_mm: Millimetres = Field(description="Radius of the weight, an upright cylinder [mm]")
    height_mm: Millimetres = Field(description="Height of the weight [mm]")
    swing_deg: Annotated[Finite, Field(ge=0, lt=90)] = Field(
        5.0, description="By how much it swings to every side [deg]"
    )
    rope_radius_mm: Millimetres = Field(10.0, description="Radius of rope and hook [mm]")


class SceneTable(Table):
    """The cell: what must not touch."""

    margin_mm: NotNegative = Field(
        10.0, description="Distance that is kept between all bodies, beyond touching [mm]"
    )
    bodies: bool = Field(
        True, description="Whether the robot's own bodies count: of its URDF or its file"
    )
    box: tuple[BoxTable, ...] = Field((), description="Boxes")
    cylinder: tuple[CylinderTable, ...] = Field((), description="Cylinders")
    capsule: tuple[CapsuleTable, ...] = Field((), description="Capsules")
    plane: tuple[PlaneTable, ...] = Field((), description="Floors and walls, which stand")
    mesh: tuple[MeshTable, ...] = Field((), description="Files of triangles")
    hanging: HangingTable | None = Field(
        None, description="A weight that hangs on a rope from the tool point"
    )
    ignore: tuple[tuple[str, str], ...] = Field(
        (), description="Pairs of bodies, by name, that may touch"
    )
    home_deg: tuple[Finite, ...] | None = Field(
        None,
        description="The pose in which the day begins and ends, one number a joint, as the "
        "controller shows it [deg; mm for a prismatic joint]",
    )


class EyeTable(Table):
    """How far and where an eye sees."""

    facing: Vector3 | None = Field(
        None,
        description="Direction to which it faces, in the world frame, from where azimuth and "
        "elevation are counted; defaults to the horizontal direction to the robot's base",
    )
    range_mm: tuple[NotNegative, Positive] | None = Field(
        None, description="Least and largest distance of a marker; defaults to any [mm]"
    )
    azimuth_deg: tuple[Degrees, Degrees] | None = Field(
        None,
        description="Least and largest azimuth, to the left of where it faces; defaults to any "
        "[deg]",
    )
    elevation_deg: tuple[Degrees, Degrees] | None = Field(
        None, description="Least and largest elevation, up from where it faces; any [deg]"
    )
    field_of_view_deg: Opening | None = Field(
        None, description="Opening of a round field of view, as cameras have one [deg]"
    )

    @field_validator("facing")
    @classmethod
    def _some_direction(cls, given: Vector3 | None) -> Vector3 | None:
        if given is not None and not any(given):
            raise PydanticCustomError("facing", "expected a direction, got zeros")
        return given

    @field_validator("range_mm", "azimuth_deg", "elevation_deg")
    @classmethod
    def _in_order(cls, given: tuple[float, float] | None) -> tuple[float, float] | None:
        if given is not None and not given[0] < given[1]:
            raise PydanticCustomError("order", "expected the least one first, then the largest")
        return given

    def eye(self, name: str, position: Array, base: Array) -> Eye:
        """The eye, where it stands (3,) [m], of a robot whose base is somewhere (3,) [m]."""
        horizontal = (base - position) * [1.0, 1.0, 0.0]
        usual = horizontal if horizontal.any() else np.eye(3)[0]
        low, high = (0.0, np.inf) if self.range_mm is None else np.array(self.range_mm) / 1e3
        cone = self.field_of_view_deg
        return Eye(
            name,
            position,
            facing(usual if self.facing is None else np.array(self.facing)),
            (float(low), float(high)),
            _radians(self.azimuth_deg),
            _radians(self.elevation_deg),
            None if cone is None or cone >= FULL else float(np.deg2rad(cone / 2)),
        )


class CameraTable(EyeTable):
    """A camera, or another instrument that must see a marker, besides the tracker of [noise]."""

    name: Line = Field("", description="Name; defaults to `camera 1` and so on")
    position_mm: Vector3 = Field(description="Where it stands, in the world frame [mm]")


class SightTable(EyeTable):
    """What the tracker of [noise] sees, and other eyes; a marker is read where each sees it.

    A marker that is not read in a pose has no rows there.
    """

    camera: tuple[CameraTable, ...] = Field(
        (), description="Cameras that must see a marker too, or alone where there is no tracker"
    )
    beam_radius_mm: NotNegative | None = Field(
        None, description="Radius of a beam, which no body of [scene] may cross; defaults to 5 [mm]"
    )
    own_body_mm: NotNegative | None = Field(
        None,
        description="Last part of a beam, which the body that carries the marker does not hide; "
        "defaults to 100 [mm]",
    )
    all_markers: bool = Field(
        False, description="Whether plans have only poses in which every marker is read"
    )

    @model_validator(mode="after")
    def _distinct_names(self) -> "SightTable":
        names = [one.name for one in self.camera if one.name]
        for i, name in enumerate(names):
            if name in names[:i]:
                raise PydanticCustomError(
                    "name", "camera {name} is named twice", {"name": repr(name)}
                )
        return self

    @property
    def of_tracker(self) -> tuple[str, ...]:
        """The keys that are given and say something of the tracker."""
        return tuple(key for key in EyeTable.model_fields if getattr(self, key) is not None)


def _radians(given: tuple[float, float] | None) -> tuple[float, float] | None:
    """Bounds [rad]; None for none, or for a whole turn."""
    if given is None or given[1] - given[0] >= FULL:
        return None
    return float(np.deg2rad(given[0])), float(np.deg2rad(given[1]))
