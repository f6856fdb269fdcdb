"""Forward kinematics and Jacobian by products of homogeneous transforms."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class Chain:
    """A serial chain as a certificate writes it down.

    Attributes:
        base: Transform (4, 4) of the chain's root [m].
        origins: Transforms (n, 4, 4) from each joint to the next at q = 0 [m].
        axes: Unit axes (n, 3) in the joints' frames.
        prismatic: Which joints (n,) are prismatic.
        limits: Lower and upper limits (2, n) [rad or m].
        tool: Transform (4, 4) of the tool after the last joint [m].
    """

    base: Array
    origins: Array
    axes: Array
    prismatic: Array
    limits: Array
    tool: Array

    @classmethod
    def from_dict(cls, robot: dict[str, Any]) -> "Chain":
        """Read a robot from a certificate.

        Raises:
            KeyError, TypeError, ValueError: The content is no robot.
        """
        joints = robot["joints"]
        axes = np.array([joint["axis"] for joint in joints], dtype=float)
        return cls(
            base=np.array(robot["base"], dtype=float),
            origins=np.array([joint["origin"] for joint in joints], dtype=float),
            axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
            prismatic=np.array([joint["kind"] == "prismatic" for joint in joints]),
            limits=np.array([joint["limits"] for joint in joints], dtype=float).T,
            tool=np.array(robot["tool"], dtype=float),
        )

    def tool_pose_and_jacobian(self, q: Array) -> tuple[Array, Array]:
        """Tool transforms (k, 4, 4) [m] and Jacobians (k, 6, n) of poses q (k, n), linear rows first.

        Column j is ``(a_j x (p - o_j), a_j)`` for a revolute joint with axis a_j through o_j, and
        ``(a_j, 0)`` for a prismatic joint.
        """
        frame = np.broadcast_to(self.base, (len(q), 4, 4))
        axes = []
        points = []
        for j in range(len(self.axes)):
            frame = frame @ self.origins[j]
            axes.append(frame[:, :3, :3] @ self.axes[j])
            points.append(frame[:, :3, 3])
            frame = frame @ self._motion(j, q[:, j])
        tool = frame @ self.tool
        columns = []
        for j, (axis, point) in enumerate(zip(axes, points, strict=True)):
            if self.prismatic[j]:
                columns.append(np.concatenate([axis, np.zeros_like(axis)], axis=1))
            else:
                swing = np.cross(axis, tool[:, :3, 3] - point)
                columns.append(np.concatenate([swing, axis], axis=1))
        return tool, np.stack(columns, axis=-1)

    def _motion(self, j: int, q: Array) -> Array:
        """Transforms (k, 4, 4) of joint j at q (k,), by the formula of Rodrigues."""
        motion = np.tile(np.eye(4), (len(q), 1, 1))
        axis = self.axes[j]
        if self.prismatic[j]:
            motion[:, :3, 3] = q[:, None] * axis
            return motion
        x, y, z = axis
        K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        sine = np.sin(q)[:, None, None]
        versine = (1.0 - np.cos(q))[:, None, None]
        motion[:, :3, :3] += sine * K + versine * (K @ K)
        return motion
