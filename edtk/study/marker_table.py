"""What instruments measure in every experiment, as a study's tables `marker` and `distance`."""

from typing import Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from edtk.study.table import Sigma, Table
from edtk.system.finite import ZERO, Vector3
from edtk.system.line import Line


class MarkerTable(Table):
    """A marker; without any, the tool point is measured."""

    name: Line = Field(
        "", description="Name of the marker, as in sheets; defaults to `marker 1` and so on"
    )
    position_mm: Vector3 = Field(
        description="Offset from the tool point in the tool frame, or with `joint` in the frame of "
        "that joint [mm]"
    )
    joint: str | None = Field(
        None, description="The marker sits on the body that this joint moves; defaults to the tool"
    )
    rows: Literal["position", "pose"] | None = Field(
        None, description="What is measured of this marker; defaults to `measurement.rows`"
    )


class DistanceTable(Table):
    """A distance that is measured from a fixed point: by a draw wire, a ballbar, an interferometer.

    The other end is the point of a marker, or has a place of its own.
    """

    name: Line = Field("", description="Name, as in sheets; defaults to `distance 1` and so on")
    anchor_mm: Vector3 = Field(description="The fixed point, in the world frame [mm]")
    marker: str | None = Field(
        None, description="Name of the marker at whose point the distance ends"
    )
    position_mm: Vector3 = Field(
        ZERO, description="The point where the distance ends, given as that of a marker [mm]"
    )
    joint: str | None = Field(
        None, description="The point sits on the body that this joint moves; defaults to the tool"
    )
    sigma_mm: Sigma | None = Field(
        None,
        description="Standard deviation of a change of this distance; defaults to "
        "`measurement.sigma_mm` [mm]",
    )

    @model_validator(mode="after")
    def _one_place(self) -> "DistanceTable":
        if self.marker is not None and {"position_mm", "joint"} & self.model_fields_set:
            raise PydanticCustomError("place", "expected marker, or a position_mm of its own")
        return self
