"""A frame of a robot file, that is turned in the frame before."""

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from edtk.model.transform import transform
from edtk.system.finite import ZERO, Vector3
from edtk.system.typing import Array

ROUNDED = 1e-3  # deviation of a rotation whose entries were typed to three decimals


def _is_rotation(R: Array) -> bool:
    """Whether a matrix (3, 3) is a rotation, to the digits that a person writes."""
    return bool(np.abs(R @ R.T - np.eye(3)).max() < ROUNDED and np.linalg.det(R) > 0)


class PlacedTable(BaseModel):
    """A frame, turned by `rpy_deg`, or by the matrix `rotation` where angles are not exact."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    rpy_deg: Vector3 = Field(
        ZERO,
        description="Roll, pitch and yaw about the fixed axes x, y and z of the frame before, in "
        "this order [deg]",
    )
    rotation: tuple[Vector3, Vector3, Vector3] | None = Field(
        None, description="The same as a rotation matrix, by rows; instead of rpy_deg [-]"
    )

    @model_validator(mode="after")
    def _one_rotation(self) -> "PlacedTable":
        if self.rotation is not None and "rpy_deg" in self.model_fields_set:
            raise PydanticCustomError("rotation", "expected one of rpy_deg and rotation")
        if self.rotation is not None and not _is_rotation(np.array(self.rotation)):
            raise PydanticCustomError(
                "rotation", "rotation: expected orthonormal rows of a right-handed frame"
            )
        return self

    def place(self, position: Vector3) -> Array:
        """Transform (4, 4) [m]."""
        if self.rotation is None:
            return transform(position, np.deg2rad(self.rpy_deg))
        T = transform(position)
        T[:3, :3] = self.rotation
        return T
