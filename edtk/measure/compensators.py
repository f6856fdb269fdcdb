"""Numbers of compensators that are unknown: what they add to the loads of the joints."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from edtk.measure.parameters import NUMBERS, Parameter, compensator_names
from edtk.robots.compensator import Pull
from edtk.robots.robot import Robot
from edtk.system.typing import Array, Indices


@dataclass(frozen=True, eq=False)
class UnknownNumbers:
    """Numbers of a robot's compensators that are parameters: by how much they differ from stated.

    Attributes:
        pulls: The compensators as they are stated.
        joints: The free joint (c,) of each.
        places: The compensator, and the place among its numbers, of each parameter.
        of: Index of each parameter among all of the model.
    """

    pulls: tuple[Pull, ...]
    joints: tuple[int, ...]
    places: tuple[tuple[int, int], ...]
    of: Indices

    @classmethod
    def among(cls, robot: Robot, parameters: Sequence[Parameter]) -> "UnknownNumbers":
        """Those among parameters of a robot."""
        own = [(i, one) for i, one in enumerate(parameters) if one.place == "compensator"]
        names = compensator_names(robot)
        joints = tuple(robot.joint_names.index(pull.given.joint) for pull in robot.pulls)
        places = tuple((names.index(one.of), NUMBERS.index(one.component)) for _, one in own)
        return cls(robot.pulls, joints, places, np.array([i for i, _ in own], dtype=int))

    def changed(self, sizes: Array) -> tuple[Pull, ...]:
        """The compensators whose numbers differ by sizes (c,), in SI units."""
        numbers = np.array([pull.given.numbers() for pull in self.pulls])
        for (which, place), size in zip(self.places, sizes, strict=True):
            numbers[which, place] += size
        pairs = zip(self.pulls, numbers, strict=True)
        return tuple(replace(pull, given=pull.given.with_numbers(own)) for pull, own in pairs)

    def torque(self, sizes: Array, q: Array) -> Array:
        """What such changes add to the loads (m, s) of the joints, at q (m, s) [N m]."""
        added = np.zeros_like(q)
        if sizes.any():
            for j, new, old in zip(self.joints, self.changed(sizes), self.pulls, strict=True):
                added[:, j] += new.torque(q[:, j]) - old.torque(q[:, j])
        return added

    def by_numbers(self, sizes: Array, q: Array) -> Array:
        """Derivatives (m, s, c) of these loads by the sizes."""
        found = np.zeros((*q.shape, len(self.places)))
        changed = self.changed(sizes) if len(self.places) else ()
        for i, (which, place) in enumerate(self.places):
            j = self.joints[which]
            found[:, j, i] = changed[which].by_numbers(q[:, j])[place]
        return found
