"""The joints of a study, as the keys of its table `joints`."""

from typing import Annotated

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError, PydanticKnownError

from edtk.study.listed import listed
from edtk.study.table import Compliance, NotNegative, Table
from edtk.system.finite import Finite

# Relative standard deviation of a known compliance that comes without one: catalogues state the
# stiffness of gears at rated torque alone, and leave bearings and links out.
KNOWN_WITHIN = 0.3
NO_SPRINGS = "no springs"  # of the context of a validation: whether all joints may be rigid


class KnownCompliance(Table):
    """A compliance that a maker or an earlier calibration tells."""

    value: Compliance = Field(description="The compliance [rad/(N m)]")
    std: Annotated[Finite, Field(ge=0, le=1e3)] | None = Field(
        None, description="Its standard deviation; defaults to 30 % of the value [rad/(N m)]"
    )

    @property
    def deviation(self) -> float:
        """The standard deviation [rad/(N m)]."""
        return KNOWN_WITHIN * self.value if self.std is None else self.std


def _form(given: object) -> str:
    """Whether a known compliance is a table or a number."""
    return ":table" if isinstance(given, dict | KnownCompliance) else ":number"


Known = Annotated[
    Annotated[Compliance, Tag(":number")] | Annotated[KnownCompliance, Tag(":table")],
    Discriminator(_form),
]


class JointsTable(Table):
    """Joints whose compliances are unknown or known, and joints that do not move."""

    unknown: Annotated[tuple[str, ...], BeforeValidator(listed)] = Field(
        description="Names of the joints whose compliances are identified"
    )
    known_rad_per_Nm: dict[str, Known] = Field(
        {},
        description="Compliances that are known, by joint; none of them is among `unknown`: a "
        "number, or `{ value = 3e-7, std = 1e-7 }` [rad/(N m)]",
    )
    fixed_deg: dict[str, Finite] = Field(
        {}, description="Angles of revolute joints that stay where they are, by joint [deg]"
    )
    fixed_mm: dict[str, Finite] = Field(
        {}, description="Positions of prismatic joints that stay where they are, by joint [mm]"
    )
    limits_deg: dict[str, tuple[Finite, Finite]] = Field(
        {},
        description="Lower and upper limits of revolute joints, by joint, in place of the robot's "
        "own, which a URDF may leave open; in the angles of its file [deg]",
    )
    limits_mm: dict[str, tuple[Finite, Finite]] = Field(
        {}, description="The same of prismatic joints [mm]"
    )

    margin_deg: NotNegative = Field(
        0.0,
        description="How far plans keep revolute joints away from their limits, at which "
        "controllers stop; poses that were measured may be nearer [deg]",
    )
    margin_mm: NotNegative = Field(0.0, description="The same of prismatic joints [mm]")

    @field_validator("unknown")
    @classmethod
    def _some(cls, given: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        """One at least, unless the study is about geometry too."""
        if not given and not (info.context or {}).get(NO_SPRINGS):
            at_least = {"field_type": "Tuple", "min_length": 1, "actual_length": 0}
            raise PydanticKnownError("too_short", at_least)
        return given

    @field_validator("limits_deg", "limits_mm")
    @classmethod
    def _in_order(cls, given: dict[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
        for name, (low, high) in given.items():
            if not low < high:
                message = "{name}: expected the lower limit before the upper one"
                raise PydanticCustomError("limits", message, {"name": name})
        return given

    def margin(self) -> dict[str, float]:
        """How far plans keep away from limits, by kind of joint [rad, m]."""
        return {"revolute": float(np.deg2rad(self.margin_deg)), "prismatic": self.margin_mm / 1e3}

    @property
    def known(self) -> dict[str, KnownCompliance]:
        """The known compliances with their standard deviations, by joint."""
        return {
            name: one if isinstance(one, KnownCompliance) else KnownCompliance(value=one, std=None)
            for name, one in self.known_rad_per_Nm.items()
        }

    def limits(self) -> dict[str, tuple[float, float]]:
        """The limits that take the place of the robot's own, by joint [rad or m]."""
        angles = {name: np.deg2rad(pair).tolist() for name, pair in self.limits_deg.items()}
        lengths = {name: [x / 1e3 for x in pair] for name, pair in self.limits_mm.items()}
        return {name: (low, high) for name, (low, high) in (angles | lengths).items()}
