"""The tie of a joint to another one, as the keys of a robot file describe it."""

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from edtk.system.finite import Finite


class MimicTable(BaseModel):
    """A joint whose variable is `factor` times that of another joint, plus an offset."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    joint: str = Field(description="Name of the joint that is followed, which follows none")
    factor: Finite = Field(
        1.0, description="Motion for one unit of the other joint's, not zero [-]"
    )
    offset_deg: Finite | None = Field(
        None, description="Angle of a revolute joint where the other joint is at zero [deg]"
    )
    offset_rad: Finite | None = Field(
        None, description="The same in radians, instead of offset_deg [rad]"
    )
    offset_m: Finite | None = Field(
        None, description="Position of a prismatic joint where the other joint is at zero [m]"
    )

    def fits(self, kind: str) -> bool:
        """Whether there is one offset at most, in the unit of this kind of joint."""
        given = {
            key
            for key in ("offset_deg", "offset_rad", "offset_m")
            if getattr(self, key) is not None
        }
        own = {"offset_m"} if kind == "prismatic" else {"offset_deg", "offset_rad"}
        return len(given) <= 1 and given <= own

    @property
    def offset(self) -> float:
        """The offset [rad or m]."""
        if self.offset_deg is not None:
            return float(np.deg2rad(self.offset_deg))
        return self.offset_rad or self.offset_m or 0.0
