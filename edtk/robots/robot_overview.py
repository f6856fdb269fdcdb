"""What a robot is for a calibration: its reach, its mass, and what loads its joints."""

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from edtk.robots.frames import BodyPoint
from edtk.robots.robot import Robot
from edtk.robots.robot_file import robot_to_dict
from edtk.robots.weights import DeadWeights
from edtk.system.presented import Presented
from edtk.system.typing import Array, Mask

POSES = 4096  # that are searched, always the same ones
NOTHING = 1e-9  # lever of a load, relative to the reach, that is rounding


Pair = tuple[str, str]


@dataclass(frozen=True)
class Part:
    """A body of a robot, as a table of its file would have it.

    Attributes:
        name: Its name.
        joint: The joint that moves it; None for one that stands.
        source: From where its shapes are.
        shapes: How many there are.
        capsules: Those that are capsules: start, end and radius of each [m].
    """

    name: str
    joint: str | None
    source: str
    shapes: int
    capsules: tuple[tuple[tuple[float, ...], tuple[float, ...], float], ...]


@dataclass(frozen=True)
class Parts:
    """The bodies of a robot, and which pairs of them a cell does not look at.

    Attributes:
        parts: The bodies.
        adjacent: Pairs that a joint connects.
        always: Other pairs whose shapes touch in every pose.
        never: Pairs whose shapes touch here and there, and whose meshes never do.
        unknown: Why there are none; empty where there are.
    """

    parts: tuple[Part, ...] = ()
    adjacent: tuple[Pair, ...] = ()
    always: tuple[Pair, ...] = ()
    never: tuple[Pair, ...] = ()
    unknown: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers in SI units."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class RobotOverview(Presented):
    """The joints of a robot, how far it reaches, and which loads turn which joint.

    Largest values are those of 4096 poses that fill the joint limits evenly, or of those of them in
    which coupled joints are within their own. Gravity points along
    -z of the base.

    Args:
        robot: The robot.
        open: Names of joints whose limits the robot's file leaves open; those of the robot are
            then one turn, or a metre to either side, and a study has to give them.
        parts: Its bodies; None where nobody asked for them.
        left_out: Joints of the end effector of a URDF, which the chain ends before.
    """

    robot: Robot
    open: tuple[str, ...] = ()
    parts: Parts | None = None
    left_out: tuple[str, ...] = ()

    def headline(self) -> str:
        """Name, number of joints and reach."""
        free = self.robot.n
        return f"{self.robot.name}, {free} joint{'s' if free > 1 else ''}, reach {self.reach:.3g} m"

    @cached_property
    def _poses(self) -> Array:
        """Joint variables (k, n) all over the limits [rad or m]."""
        from scipy.stats import qmc

        cube = qmc.Sobol(self.robot.n, seed=0).random(POSES)
        lower, upper = self.robot.limits
        q = np.asarray(lower + (upper - lower) * cube)
        possible = self.robot.bounds.coupled.hold(q)
        return q[possible] if possible.any() else q

    @cached_property
    def _frames(self) -> Any:
        return self.robot.frames(self._poses, range(len(self.robot.chain)))

    @cached_property
    def tool_points(self) -> Array:
        """Tool points (k, 3) of the poses [m]."""
        return np.asarray(self._frames.position.T)

    @property
    def reach(self) -> float:
        """Largest distance of the tool point from the frame of the base [m]."""
        return float(np.linalg.norm(self.tool_points - self.robot.base[:3, 3], axis=1).max())

    @property
    def mass(self) -> float | None:
        """Mass of all that the joints move [kg]; None where it is unknown."""
        return sum(link.mass for link in self.robot.links) if self.robot.links else None

    @cached_property
    def lever(self) -> Array:
        """Largest load of each joint (n,) by a unit force of any direction at the tool point.

        [m] for a joint that turns, 1 for one that slides.
        """
        return np.asarray(np.linalg.norm(self._frames.linear, axis=1).max(axis=-1))

    @cached_property
    def vertical_lever(self) -> Array:
        """The same of a vertical force."""
        return np.asarray(np.abs(self._frames.linear[:, 2]).max(axis=-1))

    @cached_property
    def own_weight(self) -> Array | None:
        """Largest load of each joint (n,) by the weight of the links [N m, or N if it slides]."""
        links = self.robot.links
        if not links:
            return None
        centers = tuple(BodyPoint(link.center, joint) for joint, link in enumerate(links))
        weights = DeadWeights(tuple(link.mass for link in links), centers, len(links))
        torque = self._frames.folded(weights.torque(self._frames))
        return np.asarray(np.abs(torque).max(axis=-1))

    @property
    def unloaded(self) -> Mask:
        """Joints (n,) that no force at the tool point loads."""
        return np.asarray(self.lever <= NOTHING * self.robot.reach)

    @property
    def not_by_gravity(self) -> Mask:
        """Joints (n,) that a vertical force does not load, although others do."""
        return np.asarray((self.vertical_lever <= NOTHING * self.robot.reach) & ~self.unloaded)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers in SI units; `robot` has the keys of a robot file."""
        names = self.robot.joint_names
        weight = None if self.own_weight is None else self.own_weight.tolist()
        return {
            "robot": robot_to_dict(self.robot),
            "open_limits": list(self.open),
            "left_out": list(self.left_out),
            "reach": self.reach,
            "mass": self.mass,
            "lever": dict(zip(names, self.lever.tolist(), strict=True)),
            "vertical_lever": dict(zip(names, self.vertical_lever.tolist(), strict=True)),
            "own_weight": None if weight is None else dict(zip(names, weight, strict=True)),
            "not_loaded_vertically": [
                n for n, x in zip(names, self.not_by_gravity, strict=True) if x
            ],
            "never_loaded": [n for n, x in zip(names, self.unloaded, strict=True) if x],
            "bodies": None if self.parts is None else self.parts.to_dict(),
        }
