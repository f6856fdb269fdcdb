"""A joint, as the keys of a robot file describe it."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from edtk.model.joint import ONE_TURN, Joint
from edtk.model.link import Link
from edtk.model.mimic_table import MimicTable
from edtk.model.placed_table import PlacedTable
from edtk.model.tied_joint import TiedJoint
from edtk.system.finite import Finite, Vector3


class JointTable(PlacedTable):
    """One joint: where it is in the frame of the joint before, and how it moves."""

    name: str = Field(description="Name of the joint, as in studies and in headers of tables")
    kind: Literal["revolute", "prismatic"] = Field(
        "revolute", description="Whether the joint turns (revolute) or slides (prismatic)"
    )
    origin_m: Vector3 = Field(
        description="Origin of the joint's frame in the frame of the joint before, at zero [m]"
    )
    axis: Vector3 = Field(
        description="Direction of positive motion in the joint's own frame, of length 1 or near [-]"
    )
    limits_deg: tuple[Finite, Finite] | None = Field(
        None, description="Lower and upper limit of a revolute joint [deg]"
    )
    limits_rad: tuple[Finite, Finite] | None = Field(
        None, description="The same in radians, instead of limits_deg [rad]"
    )
    limits_m: tuple[Finite, Finite] | None = Field(
        None, description="Lower and upper limit of a prismatic joint [m]"
    )
    continuous: bool = Field(
        False, description="Whether a revolute joint turns without end; it has no limits then"
    )
    mimic: MimicTable | None = Field(
        None, description="The joint that this one follows, in place of limits of its own"
    )
    mass_kg: Annotated[Finite, Field(ge=0)] | None = Field(
        None,
        description="Mass of the body that the joint moves, up to the next joint; given for all "
        "joints or for none [kg]",
    )
    center_m: Vector3 | None = Field(
        None, description="Centre of that mass in the joint's own frame; goes with mass_kg [m]"
    )

    @model_validator(mode="after")
    def _limits_fit_the_kind(self) -> "JointTable":
        allowed = ("limits_deg", "limits_rad") if self.kind == "revolute" else ("limits_m",)
        every = ("limits_deg", "limits_rad", "limits_m")
        given = [key for key in every if getattr(self, key) is not None]
        if self.mimic is not None:
            if given or self.continuous or not self.mimic.fits(self.kind):
                raise PydanticCustomError(
                    "mimic",
                    "a joint that follows another one has no limits, and an offset in its own unit",
                )
            return self
        if self.continuous:
            if given or self.kind != "revolute":
                raise PydanticCustomError(
                    "limits", "a continuous joint is revolute, and takes no limits"
                )
            return self
        if len(given) != 1 or given[0] not in allowed:
            raise PydanticCustomError(
                "limits", f"a {self.kind} joint takes {allowed[0]}, and no other limits"
            )
        return self

    @model_validator(mode="after")
    def _mass_with_its_center(self) -> "JointTable":
        if (self.mass_kg is None) != (self.center_m is None):
            raise PydanticCustomError("mass", "expected mass_kg and center_m together, or neither")
        return self

    @property
    def link(self) -> Link | None:
        """The body that the joint moves; None where it is unknown."""
        if self.mass_kg is None or self.center_m is None:
            return None
        return Link(self.mass_kg, np.array(self.center_m))

    def tied(self, place: int) -> TiedJoint:
        """The joint, at its place in the chain, that follows another one."""
        assert self.mimic is not None
        return TiedJoint(
            self.name,
            self.place(self.origin_m),
            np.array(self.axis),
            self.kind,
            place,
            self.mimic.joint,
            self.mimic.factor,
            self.mimic.offset,
        )

    def build(self) -> Joint:
        """The joint, which is free."""
        return Joint(
            self.name,
            self.place(self.origin_m),
            np.array(self.axis),
            self._limits(),
            self.kind,
            self.continuous,
        )

    def _limits(self) -> tuple[float, float]:
        if self.continuous:
            return ONE_TURN
        limits = self.limits_m or self.limits_rad or tuple(np.deg2rad(self.limits_deg or (0, 0)))
        lower, upper = limits
        return float(lower), float(upper)
