"""Joints that a load turns, and that count as rigid because no compliance is known."""

from dataclasses import dataclass

import numpy as np

from edtk.model.elastostatic_model import ElastostaticModel
from edtk.system.typing import Array

# The order of an industrial robot's joint compliances: the example by which the effect is judged.
EXAMPLE = 1e-7  # [rad/(N m)]
LEAST = 1e-6  # displacement by the example from which a joint is reported [m]


@dataclass(frozen=True)
class RigidJoint:
    """A joint that counts as rigid.

    Attributes:
        name: The joint.
        displacement: By how much 1e-7 rad/(N m) of compliance in it would move the tool point under
            the load, in the pose where that is most [m].
    """

    name: str
    displacement: float


def rigid_joints(
    model: ElastostaticModel, q: Array, wrench: Array, known: tuple[str, ...]
) -> tuple[RigidJoint, ...]:
    """Find the joints whose unknown compliance would matter in a task.

    Args:
        model: The robot with the task's tool, and weights that load it.
        q: Task poses (t, n) [rad or m].
        wrench: Their wrenches (t, 6) [N, N m].
        known: Names of the joints whose compliances are known.

    Returns:
        The revolute joints without a known compliance that the load turns, from base to tip.
    """
    robot = model.robot
    J = robot.jacobian(q)
    torque = np.einsum("tij,ti->tj", J, wrench)
    if model.weights is not None:
        torque = torque + model.torque_of(model.frames(q), np.zeros(6)).T
    moved = EXAMPLE * np.linalg.norm(J[:, :3] * torque[:, None], axis=1).max(axis=0)
    return tuple(
        RigidJoint(joint.name, float(displacement))
        for joint, displacement in zip(robot.joints, moved, strict=True)
        if joint.name not in known and joint.kind == "revolute" and displacement > LEAST
    )


def rigid_joints_in_words(joints: tuple[RigidJoint, ...]) -> str:
    """One sentence that names the joints, or an empty text for none."""
    if not joints:
        return ""
    parts = ", ".join(f"{joint.name} ({1e3 * joint.displacement:.2g} mm)" for joint in joints)
    return (
        f"without a known compliance, and so taken as rigid: {parts}; under the task's load the "
        f"tool would move so far for each {EXAMPLE:g} rad/(N m) that the joint really has"
    )
