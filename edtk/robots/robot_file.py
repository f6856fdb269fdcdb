"""Robots as data: the keys of a robot file, the chain that they describe, and the way back."""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    BeforeValidator,
    Field,
    ValidationError,
    model_validator,
)
from pydantic_core import PydanticCustomError

from edtk.robots.compensator import Compensator, Medium
from edtk.robots.controller import Controller, Follows
from edtk.robots.joint import ONE_TURN, Coupling, Joint, Link, TiedJoint
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform
from edtk.system.errors import UserError
from edtk.system.fields import ZERO, Finite, Line, Table, Vector3, first_error
from edtk.system.typing import Array

# As large numbers as the same per millimetre, a thousand times.
StiffnessPerMetre = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=1e9)]
ROUNDED = 1e-3  # deviation of a rotation whose entries were typed to three decimals
# Decimals of an angle [deg] in a file that a person wrote: what is beyond them is rounding.
DECIMALS = 12


LARGEST_FACTOR = 1e3  # of a coupling; gears between joints of an arm are far below
UNITS = {"deg": "revolute", "mm": "prismatic"}


class RobotFileError(UserError):
    """A robot that does not exist, or whose description is not as it should be."""


@contextmanager
def told_at(where: str | None, key: str | None = None) -> Iterator[None]:
    """What is wrong with a part of a robot is told with its place in the file."""
    try:
        yield
    except ValueError as error:
        raise RobotFileError(str(error), where=where, key=key) from error


class Leader(Table):
    """The joint that another one follows."""

    joint: str = Field(description="Name of the joint that is followed, of the same kind")
    factor: Annotated[Finite, Field(ge=-LARGEST_FACTOR, le=LARGEST_FACTOR)] = Field(
        1.0,
        description="How far the following joint of the model turns, in the controller's sense, "
        "for each degree that the other one is jogged while its own number stays [-]",
    )


def _name_or_table(value: object) -> object:
    """A leader by name alone has the factor 1."""
    return {"joint": value} if isinstance(value, str) else value


class ControllerTable(Table):
    """How the controller counts the joints, where that differs from the model: for a joint,
    `model = sign * (shown - zero)`; joints that are not named count as in the model.
    """

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

    def build(self, robot: Robot, where: str | None = None) -> Controller | None:
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


def controller_to_dict(robot: Robot) -> dict[str, Any]:
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


def _require_joint(name: str, robot: Robot, where: str | None, key: str) -> None:
    if name not in robot.joint_names:
        names = ", ".join(robot.joint_names)
        raise UserError(f"no joint {name!r}; this robot has {names}", where=where, key=key)


def _follows(name: str, leader: Leader, robot: Robot, where: str | None) -> Follows:
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


def _is_rotation(R: Array) -> bool:
    """Whether a matrix (3, 3) is a rotation, to the digits that a person writes."""
    return bool(np.abs(R @ R.T - np.eye(3)).max() < ROUNDED and np.linalg.det(R) > 0)


class PlacedTable(Table):
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


class CouplingTable(Table):
    """A joint whose drive stands on a body before the one that carries the joint: while the drive
    stands, the joint moves by `factor` for each degree that the other joint moves.
    """

    joint: str = Field(description="Name of the joint, whose number in a pose is its drive's angle")
    follows: str = Field(description="Name of the other joint; both turn")
    factor: Annotated[Finite, Field(ge=-LARGEST_FACTOR, le=LARGEST_FACTOR)] = Field(
        -1.0,
        description="Motion of the joint for each degree of the other one, while its drive stands; "
        "-1 where a parallelogram keeps it parallel to the body before the other joint [-]",
    )
    joint_limits_deg: tuple[Finite, Finite] | None = Field(
        None,
        description="Lower and upper limit of the joint's own angle; those of its drive are the "
        "joint's limits [deg]",
    )
    joint_limits_rad: tuple[Finite, Finite] | None = Field(
        None, description="The same in radians, instead of joint_limits_deg [rad]"
    )

    def build(self) -> Coupling:
        """The coupling [rad].

        Raises:
            ValueError: It is none; says why.
        """
        if self.joint_limits_deg is not None and self.joint_limits_rad is not None:
            raise ValueError("expected one of joint_limits_deg and joint_limits_rad")
        limits = self.joint_limits_rad
        if self.joint_limits_deg is not None:
            low, high = np.deg2rad(self.joint_limits_deg).tolist()
            limits = (low, high)
        return Coupling(self.joint, self.follows, self.factor, limits)


def coupled(robot: Robot, tables: Sequence[CouplingTable], where: str | None = None) -> Robot:
    """The robot with couplings; messages begin with `where`.

    Raises:
        RobotFileError: One of them is wrong, or no pose is left.
    """
    with told_at(where, "coupling"):
        more = tuple(table.build() for table in tables)
        return replace(robot, couplings=(*robot.couplings, *more)) if more else robot


class MimicTable(Table):
    """A joint whose variable is `factor` times that of another joint, plus an offset."""

    joint: str = Field(description="Name of the joint that is followed, which follows none")
    factor: Finite = Field(
        1.0, description="Motion for one unit of the other joint's own, not zero [-]"
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
    mimic: Annotated[
        tuple[MimicTable, ...],
        BeforeValidator(lambda given: [given] if isinstance(given, dict) else given),
    ] = Field(
        (),
        description="The joint that this one follows, or a list of those whose motions add up, in "
        "place of limits of its own",
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
        if self.mimic:
            if given or self.continuous or not all(one.fits(self.kind) for one in self.mimic):
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
        return TiedJoint(
            self.name,
            self.place(self.origin_m),
            np.array(self.axis),
            self.kind,
            place,
            tuple((one.joint, one.factor) for one in self.mimic),
            sum(one.offset for one in self.mimic),
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


class CompensatorTable(Table):
    """A coil spring or a gas cylinder between the bodies before and behind a joint, which carries
    a part of the arm's weight. It pulls its two anchors together by
    `preload + stiffness (s - s0)`, with their distance s, s0 where the joint is at zero.
    """

    joint: str = Field(description="Name of the joint, which turns and follows no other")
    anchors_mm: tuple[Vector3, Vector3] | None = Field(
        None,
        description="The anchor on the body before the joint, then that on the body that it moves, "
        "both in the joint's own frame as it stands where the joint is at zero [mm]",
    )
    anchors_m: tuple[Vector3, Vector3] | None = Field(
        None, description="The same in metres, instead of anchors_mm [m]"
    )
    stiffness_N_per_mm: Annotated[Finite, Field(ge=0)] | None = Field(
        None, description="By how much the force grows with the distance, at zero [N/mm]"
    )
    stiffness_N_per_m: StiffnessPerMetre | None = Field(
        None, description="The same per metre, instead of stiffness_N_per_mm [N/m]"
    )
    preload_N: Finite = Field(
        description="The force where the joint is at zero; negative if it pushes the anchors apart "
        "[N]"
    )
    kind: Medium = Field(
        "coil",
        description="'coil' for a spring of constant stiffness, or 'gas' for a cylinder, whose "
        "force is `preload / (1 - stiffness (s - s0) / preload)`",
    )

    @model_validator(mode="after")
    def _one_unit(self) -> "CompensatorTable":
        for one, other in (
            ("anchors_mm", "anchors_m"),
            ("stiffness_N_per_mm", "stiffness_N_per_m"),
        ):
            if (getattr(self, one) is None) == (getattr(self, other) is None):
                message = "expected {key}, and nothing in another unit"
                raise PydanticCustomError("unit", message, {"key": one})
        return self

    def build(self) -> Compensator:
        """The compensator, in SI units.

        Raises:
            ValueError: Its anchors coincide, or a gas has no force.
        """
        anchors = np.array(self.anchors_m or self.anchors_mm)
        if self.anchors_m is None:
            anchors = anchors / 1e3
        stiffness = self.stiffness_N_per_m
        if self.stiffness_N_per_mm is not None:
            stiffness = 1e3 * self.stiffness_N_per_mm
        before, behind = anchors
        return Compensator(
            self.joint, before, behind, float(stiffness or 0.0), self.preload_N, self.kind
        )


class BodyTable(Table):
    """A capsule of a part of the robot, in the frame of the joint that moves it.

    Capsules of one name are one body.
    """

    name: Line = Field(description="Name of the part, for people")
    joint: str | None = Field(
        None,
        description="The joint that moves it, in whose own frame it is given; without one it "
        "stands, in the frame of the chain's root",
    )
    from_mm: Vector3 = Field(description="One end of the capsule's middle line [mm]")
    to_mm: Vector3 = Field(description="The other end; the same one for a ball [mm]")
    radius_mm: Annotated[Finite, Field(gt=0)] = Field(description="Radius of the capsule [mm]")


class _Frame(PlacedTable):
    """A frame, placed in another one: shifted by `position_m`, and turned."""

    position_m: Vector3 = Field(description="Origin of the frame in the frame before [m]")

    def build(self) -> Array:
        return self.place(self.position_m)


class RobotFile(Table):
    """All keys of a robot file; the end of a key's name is its unit."""

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

    coupling: tuple[CouplingTable, ...] = Field(
        (), description="Joints whose drives turn them against other bodies than the one before"
    )
    controller: ControllerTable | None = Field(
        None, description="How the robot's controller counts the joints, where not as the model"
    )
    compensator: tuple[CompensatorTable, ...] = Field(
        (), description="Gravity compensators: springs and gas cylinders across joints"
    )
    body: tuple[BodyTable, ...] = Field(
        (), description="Capsules that hold the parts of the robot, for a study with a `[scene]`"
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
        robot = coupled(robot, self.coupling, where)
        robot = _with_compensators(robot, self.compensator, where)
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
            if not joint.mimic:
                continue
            key = f"joints.{i}.mimic"
            for one in joint.mimic:
                if one.joint not in free:
                    has = ", ".join(free) or "none"
                    message = f"no free joint {one.joint!r}; this robot has {has}"
                    raise RobotFileError(message, where=where, key=f"{key}.joint")
            with told_at(where, key):
                found.append(joint.tied(i))
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


def _with_compensators(
    robot: Robot, given: tuple[CompensatorTable, ...], where: str | None
) -> Robot:
    """The robot with compensators, each of which fits its joint."""
    found: list[Compensator] = []
    for i, one in enumerate(given):
        with told_at(where, f"compensator.{i}"):
            found.append(one.build())
            robot.pull_of(found[-1])
    return replace(robot, compensators=tuple(found)) if found else robot


def _joint(joint: JointTable, index: int, where: str | None) -> Joint:
    """A joint; what is wrong with it is told with its key."""
    with told_at(where, f"joints.{index}"):
        return joint.build()


class RobotAndMore(Table):
    """A robot of a file, or a built-in one, and what its file does not say."""

    file: Line = Field(description="Name of a built-in robot, or path of a robot file")
    coupling: tuple[CouplingTable, ...] = Field(
        (), description="Joints whose drives turn them against other bodies than the one before"
    )
    compensator: tuple[CompensatorTable, ...] = Field(
        (), description="Gravity compensators: springs and gas cylinders across joints"
    )

    body: tuple[BodyTable, ...] = Field(
        (), description="Capsules that hold the parts of the robot, in place of those of its file"
    )

    @classmethod
    def read(cls, content: Mapping[str, Any]) -> "RobotAndMore":
        """Check the keys.

        Raises:
            RobotFileError: One line that says which key, and what was expected.
        """
        try:
            return cls.model_validate(content)
        except ValidationError as error:
            key, message = first_error(error, cls)
            raise RobotFileError(message, key=key or None) from None

    def added(self, robot: Robot) -> Robot:
        """The robot of the file with all that is said besides.

        Raises:
            RobotFileError: That does not fit the robot.
        """
        return _with_compensators(coupled(robot, self.coupling), self.compensator, None)


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


def robot_to_dict(robot: Robot) -> dict[str, Any]:
    """Describe a robot by plain numbers, lists and texts, as `robot_from_dict` reads them.

    The robot that is read from it has the same numbers, to the last bit. Angles are written in
    degrees where degrees give back the same radians or rotation, else as `limits_rad` and
    `rotation`. A base, flange or tool that is the identity is left out.
    """
    content: dict[str, Any] = {"name": robot.name, "source": robot.source}
    for key, T in (("base", robot.base), ("flange", robot.flange), ("tool", robot.tool)):
        if not _identical(T, np.eye(4)):
            content[key] = {"position_m": T[:3, 3].tolist()} | _rotation(T[:3, :3])
    links = robot.links or (None,) * len(robot.chain)
    tied = {joint.name: joint for joint in robot.tied}
    content["joints"] = [
        _joint_to_dict(joint, tied.get(joint.name)) | _link(link)
        for joint, link in zip(robot.chain, links, strict=True)
    ]
    if robot.couplings:
        content["coupling"] = [_coupling(one) for one in robot.couplings]
    if robot.controller is not None:
        content["controller"] = controller_to_dict(robot)
    if robot.compensators:
        content["compensator"] = [_compensator_to_dict(one) for one in robot.compensators]
    return content


def _compensator_to_dict(one: Compensator) -> dict[str, Any]:
    """A compensator; millimetres where they give back the same numbers."""
    points = [one.before.tolist(), one.behind.tolist()]
    per_mm = one.stiffness / 1e3
    anchors = [[_same(1e3 * x, x, lambda mm: mm / 1e3) for x in point] for point in points]
    exact = all(x is not None for point in anchors for x in point)
    return {
        "joint": one.joint,
        **({"anchors_mm": anchors} if exact else {"anchors_m": points}),
        **(
            {"stiffness_N_per_mm": per_mm}
            if 1e3 * per_mm == one.stiffness
            else {"stiffness_N_per_m": one.stiffness}
        ),
        "preload_N": one.preload,
        **({} if one.medium == "coil" else {"kind": one.medium}),
    }


def _joint_to_dict(joint: Joint, tied: TiedJoint | None) -> dict[str, Any]:
    return {
        "name": joint.name,
        "kind": joint.kind,
        "origin_m": joint.origin[:3, 3].tolist(),
        **_rotation(joint.origin[:3, :3]),
        "axis": joint.axis.tolist(),
        **(_limits(joint) if tied is None else _mimic(tied)),
    }


def _mimic(tied: TiedJoint) -> dict[str, Any]:
    """The tie to another joint."""
    key = "offset_m" if tied.kind == "prismatic" else "offset_rad"
    first, *more = ({"joint": name, "factor": factor} for name, factor in tied.follows)
    first[key] = tied.offset
    return {"mimic": [first, *more] if more else first}


def _coupling(one: Coupling) -> dict[str, Any]:
    """A coupling, and the limits of the joint itself."""
    content = {"joint": one.joint, "follows": one.follows, "factor": one.factor}
    return content | ({} if one.limits is None else _angles("joint_limits", one.limits))


def _link(link: Link | None) -> dict[str, Any]:
    """Mass and centre of the body that a joint moves, nothing where they are unknown."""
    return {} if link is None else {"mass_kg": link.mass, "center_m": link.center.tolist()}


def _limits(joint: Joint) -> dict[str, Any]:
    """The limits, revolute ones in degrees if these give back the same radians."""
    if joint.continuous:
        return {"continuous": True}
    if joint.kind == "prismatic":
        return {"limits_m": [float(limit) for limit in joint.limits]}
    return _angles("limits", joint.limits)


def _angles(key: str, radians: tuple[float, float]) -> dict[str, Any]:
    """Angles under a key in degrees, if these give back the same radians."""
    angles = [float(angle) for angle in radians]
    degrees = [_same(np.rad2deg(angle), angle, np.deg2rad) for angle in angles]
    if any(angle is None for angle in degrees):
        return {f"{key}_rad": angles}
    return {f"{key}_deg": degrees}


def _same(degrees: float, wanted: float, convert: Callable[[float], float]) -> float | None:
    """A number near `degrees`, as round as possible, that converts to exactly the wanted one."""
    near = (round(degrees, DECIMALS), degrees, *np.nextafter(degrees, [-np.inf, np.inf]))
    return next((float(angle) for angle in near if convert(angle) == wanted), None)


def _rotation(R: Array) -> dict[str, Any]:
    """A rotation (3, 3) as angles if these give back the same matrix, nothing for the identity."""
    if _identical(R, np.eye(3)):
        return {}
    from scipy.spatial.transform import Rotation

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # at a pitch of 90 deg two of the angles are not unique
        degrees = Rotation.from_matrix(R).as_euler("xyz", degrees=True)
    for angles in (np.round(degrees, DECIMALS), degrees):
        if _identical(transform(rpy=np.deg2rad(angles))[:3, :3], R):
            return {"rpy_deg": angles.tolist()}
    return {"rotation": R.tolist()}


def _identical(a: Array, b: Array) -> bool:
    """Whether all bits agree, the signs of zeros included."""
    return bool(np.array_equal(a, b) and np.array_equal(np.signbit(a), np.signbit(b)))
