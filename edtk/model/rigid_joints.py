"""Joints that count as rigid, because their compliances are not known, although a load turns them."""

import numpy as np
from numpy.typing import NDArray

from edtk.model.robot import Robot

Array = NDArray[np.float64]
UNIT = 1e-7  # compliance [rad/(N m)] by which a person judges what is left out
LEAST = 1e-6  # displacement by that [m] from which it is said


def rigid_joints(robot: Robot, q: Array, wrench: Array, known: tuple[str, ...]) -> str:
    """What 1e-7 rad/(N m) of each joint without a known compliance would add, in words; nothing where it is nothing.

    Args:
        robot: The chain with the task's tool.
        q: Task poses (t, n) [rad or m].
        wrench: Their wrenches (t, 6) [N, N m].
        known: Names of the joints whose compliances are known.
    """
    J = robot.jacobian(q)
    torque = np.einsum("tij,ti->tj", J, wrench)
    moved = UNIT * np.linalg.norm(J[:, :3] * torque[:, None], axis=1).max(axis=0)
    parts = [
        f"{name} ({1e3 * moved[j]:.2g} mm)"
        for j, name in enumerate(robot.joint_names)
        if name not in known and robot.joints[j].kind == "revolute" and moved[j] > LEAST
    ]
    if not parts:
        return ""
    return (
        f"without a known compliance, and so taken as rigid: {', '.join(parts)}; in brackets what each {UNIT:g} "
        "rad/(N m) of it would move the tool by under the task's load"
    )
