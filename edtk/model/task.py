"""A task: the pose, the tool and the load in which the robot shall be accurate."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from edtk.model.dead_weights import DeadWeights
from edtk.model.elastostatic_model import ElastostaticModel
from edtk.model.neighbourhood import neighbourhood
from edtk.model.rigid_joints import RigidJoint, rigid_joints
from edtk.model.robot import Robot
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False, kw_only=True)
class Task:
    """One pose in which the robot works, or several, with the task's own tool and load.

    It is here that errors of compliances do harm: an error dk moves the tool point by ``A0 dk``,
    with the regressor A0 of the pose (Eq. 17, 20).

    Args:
        q: Joint variables (..., n) under load [rad or m].
        tool: Transform (4, 4) of the task's tool after the last joint [m].
        wrench: Task load (..., 6) or (6,) at the tool point in the world frame [N, N m].
        robot: The chain, with any tool.
        unknown: Indices (p,) of the joints whose compliances are to be found, or are known.
        known: Indices of further joints whose compliances are known from elsewhere.
        within: The robot shall be accurate in all poses whose joints are within this of q, see
            `neighbourhood`; zero for q alone [rad].
        lever: A rotation of the tool counts as the displacement at this distance from the tool
            point; zero if rotations do no harm [m].
        weight: How much the task counts beside others; zero for a task that is only looked at.
        dead_weights: Weights that load the joints besides the wrench; None for none.
    """

    q: Array
    tool: Array
    wrench: Array
    robot: Robot
    unknown: tuple[int, ...]
    known: tuple[int, ...] = ()
    within: float = 0.0
    lever: float = 0.0
    weight: float = 1.0
    dead_weights: DeadWeights | None = None

    @cached_property
    def model(self) -> ElastostaticModel:
        """The elastostatic model with the task's tool, for the position of the tool point."""
        robot = self.robot.with_tool(self.tool)
        return ElastostaticModel(robot, self.unknown, weights=self.dead_weights)

    @cached_property
    def regressor(self) -> Array:
        """A0 (..., 3, p): the regressor, Eq. (4), with the task's tool and load [m/(rad/(N m))]."""
        return self.model.regressor(self.q, self.wrench)

    @property
    def point(self) -> Array:
        """The tool point (..., 3) of the task [m]."""
        return self.robot.with_tool(self.tool).forward(self.q)[..., :3, 3]

    @property
    def place(self) -> str:
        """Where rho0 is the error, in words."""
        around = f"within {np.rad2deg(self.within):.3g} deg of the test pose"
        return around if self.within else "in the test pose"

    @cached_property
    def target(self) -> Array:
        """The target (r, p) of rho0: ``|target dk|^2`` is the harm of dk [m/(rad/(N m))].

        For a pose alone it is its regressor A0. Over a neighbourhood of N poses it is a triangle R
        of at most p rows with ``R'R = sum_i A_i' A_i / N``, so that the harm is the mean square of
        the errors there.
        """
        if not self.within:
            return self.harm(self.q)
        A = self.harm(neighbourhood(self.robot, self.q, self.within))
        # From the stacked rows: their squares would lose half of the digits.
        return np.asarray(np.linalg.qr(A.reshape(-1, A.shape[-1]) / np.sqrt(len(A)), mode="r"))

    def harm(self, q: Array) -> Array:
        """Rows (..., 3 or 6, p) whose squares, times dk, add up to the squared error in poses q.

        Rotation rows count with the lever: a small rotation phi moves a point at that distance from
        the tool point by up to ``lever |phi|``.

        Args:
            q: Joint variables (..., n) [rad or m].
        """
        if not self.lever:
            return self.model.regressor(q, self.wrench)
        A = replace(self.model, rows="pose").regressor(q, self.wrench)
        A[..., 3:, :] *= self.lever
        return A

    @cached_property
    def rigid_joints(self) -> tuple[RigidJoint, ...]:
        """Joints that count as rigid here although the load turns them."""
        q = self.q.reshape(-1, self.robot.n)
        wrench = np.broadcast_to(self.wrench, (*self.q.shape[:-1], 6)).reshape(-1, 6)
        known = tuple(self.robot.joint_names[j] for j in (*self.unknown, *self.known))
        return rigid_joints(self.model, q, wrench, known)
