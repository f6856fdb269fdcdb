"""Robots as data: the keys of a robot file, and the chain that they describe."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from edtk.model.controller_table import ControllerTable
from edtk.model.joint import ONE_TURN, Joint
from edtk.model.link import Link
from edtk.model.robot import Robot
from edtk.model.transform import transform
from edtk.system.errors import UserError
from edtk.system.finite import ZERO, Finite, Vector3
from edtk.system.first_error import first_error
from edtk.system.line import Line
from edtk.system.typing import Array

ROUNDED = 1e-3  # deviation of a rotation whose entries were typed to three decimals


class RobotFileError(UserError):
    """A robot that does not exist, or whose description is not as it should be."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


def _is_rotation(R: Array) -> bool:
    """Whether a matrix (3, 3) is a rotation, to the digits that a person writes."""
    return bool(np.abs(R @ R.T - np.eye(3)).max() < ROUNDED and np.linalg.det(R) > 0)


class _Placed(_Table):
    """A frame, turned by `rpy_deg`, or by the matrix `rotation` where angles are not exact."""

    rpy_deg: Vector3 = Field(
        ZERO,
        description="Roll, pitch and yaw about the fixed axes x, y and z of the frame before, in "
        "this order [deg]",
    )
    rotation: tuple[Vector3, Vector3, Vector3] | None = Field(
        None, description="The same as a rotation matrix, by rows; instead of rpy_deg [-]"
    )

    @model_validator(mode="after")
    def _one_rotation(self) -> "_Placed":
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


class _Frame(_Placed):
    """A frame, placed in another one: shifted by `position_m`, and turned."""

    position_m: Vector3 = Field(description="Origin of the frame in the frame before [m]")

    def build(self) -> Array:
        return self.place(self.position_m)


class _Joint(_Placed):
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
    mass_kg: Annotated[Finite, Field(ge=0)] | None = Field(
        None,
        description="Mass of the body that the joint moves, up to the next joint; given for all "
        "joints or for none [kg]",
    )
    center_m: Vector3 | None = Field(
        None, description="Centre of that mass in the joint's own frame; goes with mass_kg [m]"
    )

    @model_validator(mode="after")
    def _limits_fit_the_kind(self) -> "_Joint":
        allowed = ("limits_deg", "limits_rad") if self.kind == "revolute" else ("limits_m",)
        every = ("limits_deg", "limits_rad", "limits_m")
        given = [key for key in every if getattr(self, key) is not None]
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
    def _mass_with_its_center(self) -> "_Joint":
        if (self.mass_kg is None) != (self.center_m is None):
            raise PydanticCustomError("mass", "expected mass_kg and center_m together, or neither")
        return self

    @property
    def link(self) -> Link | None:
        """The body that the joint moves; None where it is unknown."""
        if self.mass_kg is None or self.center_m is None:
            return None
        return Link(self.mass_kg, np.array(self.center_m))

    def build(self) -> Joint:
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


class RobotFile(_Table):
    """All keys of a robot file; the end of a key's name is its unit."""

    name: Line = Field(description="Name of the robot, for people")
    source: str = Field(description="Where the numbers come from")
    joints: Annotated[tuple[_Joint, ...], Field(min_length=1)] = Field(
        description="The joints from base to tip, a table each"
    )
    base: _Frame = Field(
        _Frame(position_m=ZERO), description="Frame of the chain's root in the world"
    )
    tool: _Frame = Field(
        _Frame(position_m=ZERO), description="Frame of the tool in the last joint's frame"
    )
    flange: _Frame = Field(
        _Frame(position_m=ZERO),
        description="Frame in the last joint's frame, relative to which a study gives its tools",
    )

    controller: ControllerTable | None = Field(
        None, description="How the robot's controller counts the joints, where not as the model"
    )

    def build(self, where: str | None) -> Robot:
        """The robot; messages about a joint begin with `where`."""
        names = [joint.name for joint in self.joints]
        for i, name in enumerate(names):
            if name in names[:i]:
                message = f"a joint before has the name {name!r} too; expected one of its own"
                raise RobotFileError(message, where=where, key=f"joints.{i}.name")
        robot = Robot(
            self.name,
            tuple(_joint(joint, i, where) for i, joint in enumerate(self.joints)),
            base=self.base.build(),
            tool=self.tool.build(),
            source=self.source.strip(),
            links=self._links(where),
            flange=self.flange.build(),
        )
        if self.controller is None:
            return robot
        try:
            return replace(robot, controller=self.controller.build(robot))
        except UserError as error:
            raise RobotFileError(error.message, where=where, key=error.key) from error

    def _links(self, where: str | None) -> tuple[Link, ...]:
        """The bodies that the joints move; none where no mass is given."""
        links = [joint.link for joint in self.joints]
        known = tuple(link for link in links if link is not None)
        if known and len(known) < len(links):
            missing = links.index(None)
            message = (
                "other joints have masses; expected mass_kg for this one too, 0 if it has none"
            )
            raise RobotFileError(message, where=where, key=f"joints.{missing}")
        return known


def _joint(joint: _Joint, index: int, where: str | None) -> Joint:
    """A joint; what is wrong with it is told with its key."""
    try:
        return joint.build()
    except ValueError as error:
        raise RobotFileError(str(error), where=where, key=f"joints.{index}") from error


def robot_from_dict(content: Mapping[str, Any], where: str | None = None) -> Robot:
    """Build a robot from the content of a robot file, or from the same keys given in Python.

    Keys: `name`, `source`, and `joints`, a list with `name`, `origin_m`, `axis`, limits
    (`limits_deg` or `limits_rad`, or `limits_m` for a joint of `kind` "prismatic"), and optionally
    `rpy_deg`, and `mass_kg` and `center_m` of the body that it moves. A `base`, a `flange` and a
    `tool` may be given by `position_m` and `rpy_deg`. Instead of `rpy_deg`, `rotation` gives the
    matrix by rows.

    Args:
        content: The keys and their values.
        where: Beginning of a message, like "robot arm.toml"; without it a message begins with the
            key.

    Raises:
        RobotFileError: One line that says which key, and what was expected.
    """
    try:
        return RobotFile.model_validate(content).build(where)
    except ValidationError as error:
        key, message = first_error(error, RobotFile)
        raise RobotFileError(message, where=where, key=key) from error
    except RobotFileError:
        raise
    except ValueError as error:
        raise RobotFileError(str(error), where=where) from error
