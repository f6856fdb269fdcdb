"""The table `controller` of studies and robot files: how the controller counts the joints."""

from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from edtk.model.controller import Controller, Follows
from edtk.system.errors import UserError
from edtk.system.finite import Finite

if TYPE_CHECKING:
    from edtk.model.robot import Robot

LARGEST_FACTOR = 1e3  # of a coupling; gears between joints of an arm are far below
UNITS = {"deg": "revolute", "mm": "prismatic"}


class Leader(BaseModel):
    """The joint that another one follows."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    joint: str = Field(description="Name of the joint that is followed, of the same kind")
    factor: Annotated[Finite, Field(ge=-LARGEST_FACTOR, le=LARGEST_FACTOR)] = Field(
        1.0,
        description="How far the following joint of the model turns, in the controller's sense, "
        "for each degree that the other one is jogged while its own number stays [-]",
    )


def _name_or_table(value: object) -> object:
    """A leader by name alone has the factor 1."""
    return {"joint": value} if isinstance(value, str) else value


class ControllerTable(BaseModel):
    """How the controller counts the joints, where that differs from the model: for a joint,
    `model = sign * (shown - zero)`; joints that are not named count as in the model.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    sign: dict[str, Literal[1, -1]] = Field(
        {}, description="1, or -1 for a joint that the controller counts the other way round [-]"
    )
    zero_deg: dict[str, Finite] = Field(
        {},
        description="What the controller shows where the model's joint is at zero, by joint [deg]",
    )
    zero_mm: dict[str, Finite] = Field({}, description="The same of a prismatic joint [mm]")
    follows: dict[str, Annotated[Leader, BeforeValidator(_name_or_table)]] = Field(
        {},
        description="Joints that the controller counts against another joint's value: "
        '`{ q3 = "q2" }`, or with a factor `{ q3 = { joint = "q2", factor = -1 } }`; then '
        "`model = sign * (shown - zero + factor * (shown - zero of the other joint))`",
    )

    def build(self, robot: "Robot", where: str | None = None) -> Controller | None:
        """The map; None if all joints count as in the model.

        Args:
            robot: Names the joints, and says which slide.
            where: Beginning of a message.

        Raises:
            UserError: A joint does not exist, has a zero in another unit, or cannot follow.
        """
        names = robot.joint_names
        for key in ("sign", "zero_deg", "zero_mm", "follows"):
            for name in getattr(self, key):
                _require_joint(name, robot, where, f"controller.{key}")
        for unit, kind in UNITS.items():
            for name in getattr(self, f"zero_{unit}"):
                if robot.joints[names.index(name)].kind != kind:
                    message = f"the joint is not {kind}; expected its zero in the other unit"
                    raise UserError(message, where=where, key=f"controller.zero_{unit}.{name}")
        zero = self.zero_deg | self.zero_mm
        follows = tuple(_follows(one, self.follows[one], robot, where) for one in self.follows)
        try:
            found = Controller(
                sign=np.array([self.sign.get(name, 1) for name in names], dtype=float),
                zero=np.array([zero.get(name, 0.0) for name in names], dtype=float),
                units=robot.units,
                follows=follows,
            )
        except ValueError as error:
            raise UserError(str(error), where=where, key="controller.follows") from error
        same = (found.sign == 1).all() and not found.zero.any() and not follows
        return None if same else found


def controller_to_dict(robot: "Robot") -> dict[str, Any]:
    """The keys from which the robot's controller is built again, to the last bit."""
    controller = robot.controller
    if controller is None:
        return {}
    content: dict[str, dict[str, Any]] = {"sign": {}, "zero_deg": {}, "zero_mm": {}, "follows": {}}
    for joint, sign, zero in zip(robot.joints, controller.sign, controller.zero, strict=True):
        if sign < 0:
            content["sign"][joint.name] = -1
        if zero:
            key = "zero_mm" if joint.kind == "prismatic" else "zero_deg"
            content[key][joint.name] = float(zero)
    for one in controller.follows:
        leader = {"joint": robot.joint_names[one.leader], "factor": one.factor}
        content["follows"][robot.joint_names[one.joint]] = leader
    return {key: value for key, value in content.items() if value}


def _require_joint(name: str, robot: "Robot", where: str | None, key: str) -> None:
    if name not in robot.joint_names:
        names = ", ".join(robot.joint_names)
        raise UserError(f"no joint {name!r}; this robot has {names}", where=where, key=key)


def _follows(name: str, leader: Leader, robot: "Robot", where: str | None) -> Follows:
    """One coupling, of two joints of one kind."""
    key = f"controller.follows.{name}"
    _require_joint(leader.joint, robot, where, key)
    j = robot.joint_names.index(name)
    m = robot.joint_names.index(leader.joint)
    if j == m:
        raise UserError("the joint follows itself; expected another joint", where=where, key=key)
    if robot.joints[j].kind != robot.joints[m].kind:
        message = f"{leader.joint} is {robot.joints[m].kind}; expected a joint of the same kind"
        raise UserError(message, where=where, key=key)
    if not leader.factor:
        message = "the factor is 0, which is no coupling; expected another factor, or no entry"
        raise UserError(message, where=where, key=key)
    return Follows(j, m, leader.factor)
