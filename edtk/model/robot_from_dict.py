"""Robots as data: the keys of a robot file, and the chain that they describe."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from edtk.model.controller_table import ControllerTable
from edtk.model.joint import Joint
from edtk.model.joint_table import JointTable
from edtk.model.link import Link
from edtk.model.placed_table import PlacedTable
from edtk.model.robot import Robot
from edtk.model.tied_joint import TiedJoint
from edtk.system.errors import UserError
from edtk.system.finite import ZERO, Vector3
from edtk.system.first_error import first_error
from edtk.system.line import Line
from edtk.system.typing import Array


class RobotFileError(UserError):
    """A robot that does not exist, or whose description is not as it should be."""


class _Frame(PlacedTable):
    """A frame, placed in another one: shifted by `position_m`, and turned."""

    position_m: Vector3 = Field(description="Origin of the frame in the frame before [m]")

    def build(self) -> Array:
        return self.place(self.position_m)


class RobotFile(BaseModel):
    """All keys of a robot file; the end of a key's name is its unit."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Line = Field(description="Name of the robot, for people")
    source: str = Field(description="Where the numbers come from")
    joints: Annotated[tuple[JointTable, ...], Field(min_length=1)] = Field(
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
            tuple(
                _joint(joint, i, where) for i, joint in enumerate(self.joints) if not joint.mimic
            ),
            base=self.base.build(),
            tool=self.tool.build(),
            source=self.source.strip(),
            links=self._links(where),
            flange=self.flange.build(),
            tied=self._tied(where),
        )
        if self.controller is None:
            return robot
        try:
            return replace(robot, controller=self.controller.build(robot))
        except UserError as error:
            raise RobotFileError(error.message, where=where, key=error.key) from error

    def _tied(self, where: str | None) -> tuple[TiedJoint, ...]:
        """The joints that follow others, which have to be free."""
        free = [joint.name for joint in self.joints if not joint.mimic]
        found = []
        for i, joint in enumerate(self.joints):
            if joint.mimic is None:
                continue
            key = f"joints.{i}.mimic"
            if joint.mimic.joint not in free:
                has = ", ".join(free) or "none"
                message = f"no free joint {joint.mimic.joint!r}; this robot has {has}"
                raise RobotFileError(message, where=where, key=f"{key}.joint")
            try:
                found.append(joint.tied(i))
            except ValueError as error:
                raise RobotFileError(str(error), where=where, key=key) from error
        return tuple(found)

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


def _joint(joint: JointTable, index: int, where: str | None) -> Joint:
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
        raise RobotFileError(message, where=where, key=key or None) from None
    except RobotFileError:
        raise
    except ValueError as error:
        raise RobotFileError(str(error), where=where) from error
