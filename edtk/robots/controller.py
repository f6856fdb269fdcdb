"""How a controller counts the joints: sign, zero and coupling, and the table that says so."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from edtk.system.errors import UserError
from edtk.system.fields import Finite
from edtk.system.typing import Array

if TYPE_CHECKING:
    from edtk.robots.robot import Robot

LARGEST_FACTOR = 1e3  # of a coupling; gears between joints of an arm are far below
UNITS = {"deg": "revolute", "mm": "prismatic"}


@dataclass(frozen=True)
class Follows:
    """A joint whose value the controller counts against another joint.

    Attributes:
        joint: Index of the joint that follows.
        leader: Index of the joint that it follows.
        factor: Motion of the follower's joint for one unit that the leader is jogged, while the
            follower's own number stays.
    """

    joint: int
    leader: int
    factor: float


@dataclass(frozen=True, eq=False)
class Controller:
    """An affine map between the controller's joint values c and the model's joint variables q.

    ``q_j = s_j (c_j - z_j + f_j (c_m - z_m))``, where the last term is there for a joint j that
    follows a joint m only: its controller counts it against something that m does not turn, as with
    a forearm whose angle to the horizon is shown. Both are in SI units; at q = 0 the controller
    shows its zeros z.

    Args:
        sign: 1 or -1 (n,) for each joint.
        zero: What the controller shows in the model's zero pose (n,) [deg or mm]; degrees, for they
            are typed, and a file shall give the same digits back.
        units: SI units in one unit of `zero` (n,).
        follows: The joints that follow others.

    Raises:
        ValueError: Joints follow each other in a circle.
    """

    sign: Array
    zero: Array
    units: Array
    follows: tuple[Follows, ...] = ()

    def __post_init__(self) -> None:
        # Without a circle the coupling is nilpotent: no product of n couplings is left.
        if np.linalg.matrix_power(self._coupling != 0, len(self.sign)).any():
            raise ValueError("joints follow each other in a circle")

    @cached_property
    def _coupling(self) -> Array:
        """Factors f (n, n): row j has that of the joint which j follows."""
        coupling = np.zeros((len(self.sign), len(self.sign)))
        for one in self.follows:
            coupling[one.joint, one.leader] = one.factor
        return coupling

    @cached_property
    def _zero(self) -> Array:
        """Zeros (n,) [rad or m]."""
        return np.asarray(self.zero * self.units)

    @cached_property
    def _uncoupled(self) -> Array:
        """Inverse (n, n) of the coupling: controller's values from joints less their signs."""
        return np.asarray(np.linalg.inv(np.eye(len(self.sign)) + self._coupling), dtype=float)

    def leaders(self, joint: int) -> tuple[int, ...]:
        """The joint that a joint follows, the one that this follows, and so on."""
        direct = [one.leader for one in self.follows if one.joint == joint]
        return (*direct, *(further for leader in direct for further in self.leaders(leader)))

    def model_of(self, shown: Array) -> Array:
        """Joint variables of the model (..., n) for the controller's values (..., n) [rad or m]."""
        from_zero = shown - self._zero
        if self.follows:
            from_zero = from_zero + from_zero @ self._coupling.T
        return np.asarray(self.sign * from_zero)

    def shown_of(self, q: Array) -> Array:
        """The controller's values (..., n) for joint variables of the model (..., n) [rad or m]."""
        return self.shown_change(q) + self._zero

    def shown_change(self, change: Array) -> Array:
        """Change (..., n) of the controller's values for a change (..., n) of the model's."""
        from_zero: Array = self.sign * change
        return from_zero @ self._uncoupled.T if self.follows else from_zero


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
