"""What a URDF file says: links, and joints that connect them."""

from dataclasses import dataclass
from functools import cached_property

from edtk.model.link import Link
from edtk.system.typing import Array


@dataclass(frozen=True)
class Mimic:
    """A joint's tie to another one: ``q = factor * q_master + offset``.

    Attributes:
        master: Name of the joint that is followed.
        factor: Factor [rad/rad, m/m, or mixed].
        offset: Value where the master is at zero [rad or m].
    """

    master: str
    factor: float
    offset: float


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """A joint of a URDF file.

    Attributes:
        name: Its name.
        kind: "fixed", "revolute", "continuous", "prismatic", "floating" or "planar".
        parent: Name of the link that carries it.
        child: Name of the link that it moves.
        origin: Transform (4, 4) of its frame in the parent's [m].
        axis: Axis (3,) of positive motion in its own frame, of any length.
        limits: Lower and upper limit [rad or m]; None for each that the file does not give.
        mimic: The tie to another joint; None for a joint of its own.
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: Array
    axis: Array
    limits: tuple[float | None, float | None]
    mimic: Mimic | None


@dataclass(frozen=True, eq=False)
class Urdf:
    """A tree of links and joints.

    Attributes:
        name: Name of the robot.
        links: Mass and centre of each link in its own frame, by name; None where the file has none.
        joints: The joints by name, in the order of the file.
    """

    name: str
    links: dict[str, Link | None]
    joints: dict[str, UrdfJoint]

    @cached_property
    def above(self) -> dict[str, UrdfJoint]:
        """The joint that moves a link, by the name of the link; roots have none."""
        return {joint.child: joint for joint in self.joints.values()}

    @cached_property
    def below(self) -> dict[str, list[UrdfJoint]]:
        """The joints that a link carries, by the name of the link."""
        carried: dict[str, list[UrdfJoint]] = {name: [] for name in self.links}
        for joint in self.joints.values():
            carried[joint.parent].append(joint)
        return carried

    @property
    def roots(self) -> list[str]:
        """The links that no joint moves."""
        return [name for name in self.links if name not in self.above]
