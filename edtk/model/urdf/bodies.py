"""What each joint of a chain carries: the masses of a URDF file, body by body."""

from collections.abc import Sequence

import numpy as np

from edtk.model.link import Link
from edtk.model.urdf.motion import motion
from edtk.model.urdf.urdf import Urdf, UrdfJoint
from edtk.system.typing import Array


def bodies(tree: Urdf, moving: Sequence[UrdfJoint]) -> tuple[Link, ...]:
    """Lump the links that each joint of a chain moves into one body, up to the next joint.

    Links behind fixed joints belong to the body. So do branches beside the chain, whose joints
    stand at zero, or at the limit that is nearest to it: their weight is carried all the same. A
    link without inertia has no mass, as URDF has it.

    Args:
        tree: The links and joints.
        moving: The joints of the chain that move, from base to tip.

    Returns:
        Mass and centre of each body in the frame of its joint; empty if all masses are zero.
    """
    carriers = {joint.name for joint in moving}
    found = tuple(_body(tree, joint, carriers) for joint in moving)
    return found if any(link.mass for link in found) else ()


def _body(tree: Urdf, carrier: UrdfJoint, carriers: set[str]) -> Link:
    mass = 0.0
    moment = np.zeros(3)
    waiting = [(carrier.child, np.eye(4))]
    while waiting:
        name, T = waiting.pop()
        link = tree.links[name]
        if link is not None:
            mass += link.mass
            moment += link.mass * (T[:3, :3] @ link.center + T[:3, 3])
        waiting += [
            (joint.child, T @ joint.origin @ _at_rest(joint))
            for joint in tree.below[name]
            if joint.name not in carriers
        ]
    return Link(mass, moment / mass if mass else moment)


def _at_rest(joint: UrdfJoint) -> Array:
    """Motion (4, 4) of a joint beside the chain [m]."""
    lower, upper = joint.limits
    q = 0.0 if lower is None else max(0.0, lower)
    return motion(joint, q if upper is None else min(q, upper))
