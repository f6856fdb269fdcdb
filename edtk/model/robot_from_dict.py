"""Robots as data: the keys of a robot file, and the chain that they describe."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from edtk.model.joint import Joint
from edtk.model.robot import Robot
from edtk.model.transform import transform
from edtk.system.errors import UserError
from edtk.system.typing import Array

Finite = Annotated[float, Field(allow_inf_nan=False)]
Vector3 = tuple[Finite, Finite, Finite]
ZERO: Vector3 = (0.0, 0.0, 0.0)


class RobotFileError(UserError):
    """A robot that does not exist, or whose description is not as it should be."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Placed(_Table):
    """A frame, turned by `rpy_deg`, or by the matrix `rotation` where angles are not exact."""

    rpy_deg: Vector3 = ZERO
    rotation: tuple[Vector3, Vector3, Vector3] | None = None

    @model_validator(mode="after")
    def _one_rotation(self) -> "_Placed":
        if self.rotation is not None and "rpy_deg" in self.model_fields_set:
            raise ValueError("expected one of rpy_deg and rotation")
        return self

    def place(self, position: Vector3) -> Array:
        """Transform (4, 4) [m]."""
        if self.rotation is None:
            return transform(position, np.deg2rad(self.rpy_deg))
        T = transform(position)
        T[:3, :3] = self.rotation
        return T


class _Frame(_Placed):
    position_m: Vector3

    def build(self) -> Array:
        return self.place(self.position_m)


class _Joint(_Placed):
    name: str
    kind: Literal["revolute", "prismatic"] = "revolute"
    origin_m: Vector3
    axis: Vector3
    limits_deg: tuple[Finite, Finite] | None = None
    limits_rad: tuple[Finite, Finite] | None = None
    limits_m: tuple[Finite, Finite] | None = None

    @model_validator(mode="after")
    def _limits_fit_the_kind(self) -> "_Joint":
        allowed = ("limits_deg", "limits_rad") if self.kind == "revolute" else ("limits_m",)
        every = ("limits_deg", "limits_rad", "limits_m")
        given = [key for key in every if getattr(self, key) is not None]
        if len(given) != 1 or given[0] not in allowed:
            raise ValueError(f"a {self.kind} joint takes {allowed[0]}, and no other limits")
        return self

    def build(self) -> Joint:
        limits = self.limits_m or self.limits_rad or tuple(np.deg2rad(self.limits_deg or (0, 0)))
        lower, upper = limits
        origin = self.place(self.origin_m)
        return Joint(
            self.name, origin, np.array(self.axis), (float(lower), float(upper)), self.kind
        )


class _Robot(_Table):
    name: str
    source: str
    joints: Annotated[tuple[_Joint, ...], Field(min_length=1)]
    base: _Frame = _Frame(position_m=ZERO)
    tool: _Frame = _Frame(position_m=ZERO)

    def build(self) -> Robot:
        return Robot(
            self.name,
            tuple(joint.build() for joint in self.joints),
            base=self.base.build(),
            tool=self.tool.build(),
            source=self.source.strip(),
        )


def robot_from_dict(content: Mapping[str, Any], where: str | None = None) -> Robot:
    """Build a robot from the content of a robot file, or from the same keys given in Python.

    Keys: `name`, `source`, and `joints`, a list with `name`, `origin_m`, `axis`, limits
    (`limits_deg` or `limits_rad`, or `limits_m` for a joint of `kind` "prismatic"), and optionally
    `rpy_deg`. A `base` and a `tool` may be given by `position_m` and `rpy_deg`. Instead of
    `rpy_deg`, `rotation` gives the matrix by rows.

    Args:
        content: The keys and their values.
        where: Beginning of a message, like "robot arm.toml"; without it a message begins with the
            key.

    Raises:
        RobotFileError: One line that says which key, and what was expected.
    """
    try:
        return _Robot.model_validate(content).build()
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        raise RobotFileError(first["msg"], where=where, key=key) from error
    except ValueError as error:
        raise RobotFileError(str(error), where=where) from error
