"""A task: the pose, the tool and the load in which the robot shall be accurate."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.rigid_joints import RigidJoint, rigid_joints
from edtk.model.robot import Robot
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False, kw_only=True)
class Task:
    """One pose in which the robot works, or several, with the task's own tool and load.

    It is here that errors of compliances do harm: an error dk moves the tool point by ``A0 dk``,
    with the target A0 of the pose (Eq. 17, 20).

    Args:
        q: Joint variables (..., n) under load [rad or m].
        tool: Transform (4, 4) of the task's tool after the last joint [m].
        wrench: Task load (..., 6) or (6,) at the tool point in the world frame [N, N m].
        robot: The chain, with any tool.
        unknown: Indices (p,) of the joints whose compliances are to be found, or are known.
    """

    q: Array
    tool: Array
    wrench: Array
    robot: Robot
    unknown: tuple[int, ...]

    @cached_property
    def model(self) -> ElastostaticModel:
        """The elastostatic model with the task's tool, for the position of the tool point."""
        return ElastostaticModel(self.robot.with_tool(self.tool), self.unknown)

    @cached_property
    def target(self) -> Array:
        """A0 (..., 3, p): the regressor, Eq. (4), with the task's tool and load [m/(rad/(N m))]."""
        return self.model.regressor(self.q, self.wrench)

    @cached_property
    def rigid_joints(self) -> tuple[RigidJoint, ...]:
        """Joints that count as rigid here although the load turns them."""
        q = self.q.reshape(-1, self.robot.n)
        wrench = np.broadcast_to(self.wrench, (*self.q.shape[:-1], 6)).reshape(-1, 6)
        known = tuple(self.robot.joint_names[j] for j in self.unknown)
        return rigid_joints(self.model.robot, q, wrench, known)
