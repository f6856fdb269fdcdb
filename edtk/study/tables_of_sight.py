"""Tables of a study about what its instrument sees: range, angles, cameras."""

from typing import Annotated

import numpy as np
from pydantic import Field, field_validator, model_validator
from pydantic_core import PydanticCustomError

from edtk.cell.sight import Eye, facing
from edtk.system.fields import Finite, Line, NotNegative, Positive, Table, Vector3
from edtk.system.typing import Array

ACCEPTANCE = 30.0  # [deg] of a 1.5-inch spherically mounted reflector
Degrees = Annotated[Finite, Field(ge=-360, le=360)]
Opening = Annotated[Finite, Field(gt=0, le=360)]
FULL = 360.0


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
