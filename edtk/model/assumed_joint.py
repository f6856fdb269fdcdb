"""Joints whose compliances nobody measures: what is taken of them, and how far that may be off."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from edtk.model.robot import Robot
from edtk.system.typing import Array

SAMPLE = 256  # poses within the limits, in which levers are looked for
SHORTEST = 1e-3  # lever of a joint whose axis runs through the tool point [m]
# Gears are chosen so that the largest load turns them by minutes of arc.
BENT = 1e-3  # [rad]
SOFTEST = 1e-4  # no gear of a robot is softer, wrists of small collaborative robots included


@dataclass(frozen=True)
class AssumedJoint:
    """A joint whose compliance is not identified.

    Attributes:
        name: The joint.
        index: Its index among the robot's joints.
        compliance: What the model takes: a known compliance, or zero of a joint that counts as
            rigid [rad/(N m)].
        std: How far the true compliance may be from that, at one standard deviation.
        source: Where that comes from, in words.
    """

    name: str
    index: int
    compliance: float
    std: float
    source: str

    @property
    def rigid(self) -> bool:
        """Whether it counts as rigid."""
        return self.compliance == 0.0


@dataclass(frozen=True, eq=False)
class AssumedError:
    """A joint that is not identified, and what its error does to the estimates.

    Attributes:
        joint: The joint.
        shifts: By how much estimates (p,) are off if its true compliance is one standard deviation
            more than is taken [rad/(N m)].
    """

    joint: AssumedJoint
    shifts: Array


@dataclass(frozen=True)
class Likely:
    """A compliance that a joint is likely to have.

    Attributes:
        compliance: Its size [rad/(N m)].
        source: Where it comes from, in words.
    """

    compliance: float
    source: str


def levers(robot: Robot) -> Array:
    """The largest distance (n,) of the tool point from each joint's axis [m].

    A gear is chosen for the load that it may have to hold, which is a force at the tool times this
    lever, whichever way the force points: so levers put joints in the order of their capacities.
    They are looked for in poses within the joint limits, ``max |dp/dq_j|``.
    """
    lower, upper = np.clip(robot.limits, -np.pi, np.pi)
    q = np.random.default_rng(0).uniform(lower, upper, (SAMPLE, robot.n))
    found = np.linalg.norm(robot.jacobian(q)[:, :3], axis=1).max(axis=0)
    return np.asarray(np.maximum(found, SHORTEST))


def as_neighbours(
    lever: Array, k: Mapping[int, float], joint: int, names: tuple[str, ...]
) -> Likely:
    """The compliance of a joint from those that are known of its neighbours by load capacity.

    It lies on a line of logarithms between the next longer and the next shorter lever; beyond the
    last of them it is that of the last.

    Args:
        lever: Levers (n,) of all joints [m].
        k: Positive compliances of some joints, by index [rad/(N m)].
        joint: Index of the joint.
        names: Names (n,) of the joints.
    """
    near = sorted(k, key=lambda other: lever[other])
    at = np.log(lever[near])
    here = float(np.log(lever[joint]))
    size = float(np.exp(np.interp(here, at, np.log([k[other] for other in near]))))
    above = int(np.searchsorted(at, here))
    ends = near[max(above - 1, 0) : above + 1]
    between = " and ".join(names[other] for other in sorted(ends))
    return Likely(size, f"as {between}, the nearest by load capacity")


def by_load(lever: float, force: float) -> Likely:
    """The compliance of a gear that the largest load on it turns by a milliradian.

    Args:
        lever: Its lever [m].
        force: Size of the force at the tool [N].
    """
    size = min(BENT / (lever * force), SOFTEST) if force > 0 else SOFTEST
    return Likely(size, "a gear that the load turns by 1 mrad at most")
