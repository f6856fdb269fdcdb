"""A chain on which the tests of this folder rest: nothing in it is parallel, square or centred."""

from dataclasses import replace

import numpy as np

from edtk.robots.joint import Coupling, Joint, TiedJoint
from edtk.robots.robot import Robot
from edtk.robots.rotations import transform

KINDS = ("revolute", "prismatic", "revolute", "revolute", "prismatic", "revolute", "revolute")


def mixed_chain(n: int = len(KINDS)) -> Robot:
    """Both kinds of joint on skew axes, with rotated origins, and base and tool transforms."""
    rng = np.random.default_rng(0)
    joints = tuple(
        Joint(
            f"q{i + 1}",
            transform(rng.normal(size=3), rng.uniform(-3, 3, size=3)),
            rng.normal(size=3),
            (-2.0, 2.0),
            kind,
        )
        for i, kind in enumerate(KINDS[:n])
    )
    base = transform([0.3, -0.2, 0.5], [0.4, -0.7, 1.1])
    return Robot("mixed", joints, base, transform([0.2, 0.1, -0.3], [1.0, 0.2, -0.5]))


def tied_chain() -> Robot:
    """Six joints, of which the second follows the fifth, and the fourth the first."""
    free = mixed_chain(6)
    ties = {1: ((("q5", -0.7),), 0.2), 3: ((("q1", 1.5),), -0.4)}
    tied = tuple(
        TiedJoint(joint.name, joint.origin, joint.axis, joint.kind, place, *ties[place])
        for place, joint in enumerate(free.joints)
        if place in ties
    )
    joints = tuple(joint for place, joint in enumerate(free.joints) if place not in ties)
    return replace(free, joints=joints, tied=tied)


def coupled_chain() -> Robot:
    """The same, whose drives pass other joints: the third that of the first, the last the third."""
    couplings = (Coupling("q6", "q3", -0.8), Coupling("q3", "q1", 0.5))
    return replace(tied_chain(), couplings=couplings)
