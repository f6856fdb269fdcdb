"""Robots that give way in more directions than their motors turn them."""

from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import numpy as np

from edtk.robots.compensator import Pull
from edtk.robots.frames import BodyPoint, Frames
from edtk.robots.joint import Joint, Kind, Ties
from edtk.robots.robot import Robot
from edtk.robots.rotations import rotation, transform
from edtk.robots.weights import DeadWeights
from edtk.system.typing import Array

SIXTH = 6  # components of a frame: shifts along its axes, then turns about them
FAR = 0.5  # [rad or m] an elastic joint never turns or slides so far


@dataclass(frozen=True)
class ElasticJoint:
    """A joint that nobody drives: a spring brings it back to zero where nothing loads it.

    Attributes:
        before: Name of the joint of the chain in the frame before which it is.
        component: 0 to 2 for a shift along an axis of that frame, 3 to 5 for a turn about one.
        name: Its own name.
    """

    before: str
    component: int
    name: str

    @property
    def kind(self) -> Kind:
        """Whether it turns or slides."""
        return "revolute" if self.component >= SIXTH // 2 else "prismatic"

    def placed(self, origin: Array) -> Joint:
        """The joint, where its frame begins."""
        return Joint(self.name, origin, np.eye(3)[self.component % 3], (-FAR, FAR), self.kind)


@dataclass(frozen=True, eq=False)
class ElasticRobot(Robot):
    """A robot with elastic joints in the frames before its own joints.

    Its free joints are those of the rigid robot in their order, then the elastic ones. So loads,
    columns and slopes by the first n are those by what the motors turn. Commanded poses leave all
    others at zero, where the chain is that of the rigid robot: `extended` puts the zeros in.

    Args:
        elastic: The elastic joints, the last of `joints`; those before one joint follow each other.
    """

    elastic: tuple[ElasticJoint, ...] = field(default=())

    @classmethod
    def of(cls, robot: Robot, elastic: tuple[ElasticJoint, ...]) -> Robot:
        """The robot with elastic joints; the robot itself without any."""
        if not elastic:
            return robot
        own = {one.name: getattr(robot, one.name) for one in fields(Robot)}
        joints = (*robot.joints, *(one.placed(transform()) for one in elastic))
        # Weights and compensators load a robot from outside, see `weights_of`.
        bare = {"joints": joints, "links": (), "compensators": (), "controller": None}
        return cls(**(own | bare), elastic=elastic)

    @property
    def driven(self) -> int:
        """Number n of the joints that motors turn."""
        return len(self.joints) - len(self.elastic)

    @cached_property
    def rigid(self) -> Robot:
        """The chain without elastic joints."""
        own = {one.name: getattr(self, one.name) for one in fields(Robot)}
        return Robot(**(own | {"joints": self.joints[: self.driven]}))

    @cached_property
    def chain(self) -> tuple[Joint, ...]:
        """All joints from base to tip; the first in the frame before a joint has its origin."""
        found: list[Joint] = []
        for joint in self.rigid.chain:
            origin = joint.origin
            for one in self.elastic:
                if one.before == joint.name:
                    found.append(one.placed(origin))
                    origin = transform()
            found.append(replace(joint, origin=origin))
        return tuple(found)

    @cached_property
    def body_names(self) -> tuple[str, ...]:
        """Names of all joints of `chain`."""
        return tuple(joint.name for joint in self.chain)

    @cached_property
    def ties(self) -> Ties:
        """How all joints of the chain follow the free ones."""
        names = self.body_names
        rigid, n = self.rigid, self.driven
        matrix = np.zeros((len(names), len(self.joints)))
        offset = np.zeros(len(names))
        places = [names.index(name) for name in rigid.body_names]
        matrix[places, :n] = np.eye(n) if rigid.ties is None else rigid.ties.matrix
        offset[places] = 0.0 if rigid.ties is None else rigid.ties.offset
        elastic = [names.index(one.name) for one in self.elastic]
        matrix[elastic, range(n, len(self.joints))] = 1.0
        free = [names.index(joint.name) for joint in self.joints]
        return Ties(matrix, offset, free)

    def extended(self, q: Array) -> Array:
        """Variables (..., s) of all free joints, for those (..., n) of the driven ones, or all."""
        return widened(q, self.n)

    def frames(self, q: Array, bodies: tuple[int, ...] = ()) -> Frames:  # type: ignore[override]
        """See `Robot.frames`; elastic joints that are left out are at zero."""
        return super().frames(self.extended(np.asarray(q, dtype=float)), bodies)


def widened(q: Array, width: int) -> Array:
    """Variables (..., width) of all free joints, of which the last may be left out for zeros."""
    missing = width - q.shape[-1]
    if not missing:
        return q
    return np.concatenate([q, np.zeros((*q.shape[:-1], missing))], axis=-1)


def body_of(robot: Robot, joint: int | None) -> int | None:
    """Index in the chain of a robot, of a joint of the rigid one's chain; None for the tool."""
    if joint is None or not isinstance(robot, ElasticRobot):
        return joint
    return robot.body_names.index(robot.rigid.body_names[joint])


def point_of(robot: Robot, point: BodyPoint) -> BodyPoint:
    """A point of the rigid robot, on the chain of a robot."""
    return replace(point, joint=body_of(robot, point.joint))


def weights_of(robot: Robot, weights: DeadWeights | None) -> DeadWeights | None:
    """Weights that hang on the rigid robot, on the chain of a robot."""
    if weights is None or not isinstance(robot, ElasticRobot):
        return weights
    centers = tuple(point_of(robot, center) for center in weights.centers)
    pulls = tuple(pull_on(robot, pull) for pull in weights.pulls)
    return DeadWeights(weights.masses, centers, len(robot.chain), pulls)


def pull_on(robot: Robot, pull: Pull) -> Pull:
    """A compensator of the rigid robot, on the chain of a robot."""
    if not isinstance(robot, ElasticRobot):
        return pull
    name = robot.rigid.body_names[pull.place]
    place = robot.body_names.index(name)
    count = sum(one.before == name for one in robot.elastic)
    return replace(pull, place=place, elastic=robot.chain[place - count : place])


def turning_about(robot: Robot, frames: Frames, joint: int, axis: int) -> Frames:
    """The chain as if a joint turned about an axis of the frame before it, and not about its own.

    Only what that joint does is to be read of it. What follows the joint does not follow the turn.

    Args:
        robot: The robot.
        frames: Its poses.
        joint: Index of the free joint.
        axis: Which axis, 0 to 2.
    """
    place = joint if frames.ties is None else frames.ties.free[joint]
    own = robot.chain[place]
    bodies = frames.bodies
    if place not in bodies:
        bodies = robot.frames(np.moveaxis(frames.q, 0, -1), (place,)).bodies
    turned, _ = bodies[place]
    variables = frames.q if frames.ties is None else frames.ties.variables(frames.q)
    angle = variables[place] * (own.kind == "revolute")
    local = rotation(-angle[:, None] * own.axis) @ np.eye(3)[axis]
    axes, prismatic = frames.axes.copy(), frames.prismatic.copy()
    axes[place] = np.einsum("kcm,mk->cm", turned, local)
    prismatic[place] = False
    ties = frames.ties
    if ties is not None:
        alone = np.zeros_like(ties.matrix)
        alone[ties.free, range(len(ties.free))] = 1.0
        ties = replace(ties, matrix=alone)
    return replace(frames, axes=axes, prismatic=prismatic, ties=ties)
