"""A tool, and a load at its point, as the keys of tables of a study."""

import numpy as np
from pydantic import Field

from edtk.model.transform import transform
from edtk.study.table import Table
from edtk.system.finite import ZERO, Vector3
from edtk.system.typing import Array


class Tool(Table):
    """Tool frame after the last joint, or after the flange: the tip link of a URDF."""

    position_mm: Vector3 = Field(
        description="Tool point in the last joint's frame, or in a URDF's tip link [mm]"
    )
    rpy_deg: Vector3 = Field(
        ZERO, description="Roll, pitch and yaw about the fixed axes of that frame [deg]"
    )

    def build(self) -> Array:
        """Transform (4, 4) [m]."""
        return transform(np.array(self.position_mm) / 1e3, np.deg2rad(self.rpy_deg))


class Load(Table):
    """Wrench at the tool point, in the world frame."""

    F_N: Vector3 = Field(description="Force, in world axes at the tool point [N]")
    T_Nm: Vector3 = Field(ZERO, description="Torque, in world axes [N m]")

    def build(self) -> Array:
        """Wrench (6,) [N, N m]."""
        return np.array([*self.F_N, *self.T_Nm])
