"""Numbers of compensators that are unknown: what they add to the loads of the joints."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from edtk.measure.parameters import NUMBERS, Parameter, compensator_names
from edtk.robots.compensator import Pull
from edtk.robots.elastic_robot import ElasticJoint, ElasticRobot, pull_on
from edtk.robots.robot import Robot
from edtk.system.typing import Array, Indices


@dataclass(frozen=True, eq=False)
class UnknownNumbers:
    """Numbers of a robot's compensators that are parameters: by how much they differ from stated.

    Attributes:
        pulls: The compensators as they are stated.
        joints: The free joint (c,) of each.
        loaded: Coordinates that each loads: elastic joints before its own, and that.
        places: The compensator, and the place among its numbers, of each parameter.
        of: Index of each parameter among all of the model.
    """

    pulls: tuple[Pull, ...]
    joints: tuple[int, ...]
    loaded: tuple[list[int], ...]
    places: tuple[tuple[int, int], ...]
    of: Indices

    @classmethod
    def among(
        cls, robot: Robot, elastic: tuple[ElasticJoint, ...], parameters: Sequence[Parameter]
    ) -> "UnknownNumbers":
        """Those among parameters of a robot.

        Args:
            robot: The rigid robot.
            elastic: The elastic joints, whose coordinates come after those of its free joints.
            parameters: Of which some are numbers of compensators.
        """
        whole = ElasticRobot.of(robot, elastic)
        pulls = tuple(pull_on(whole, pull) for pull in robot.pulls)
        between = ([whole.body_names[i] for i in pull.places] for pull in pulls)
        loaded = tuple([whole.joint_names.index(name) for name in names] for names in between)
        own = [(i, one) for i, one in enumerate(parameters) if one.place == "compensator"]
        names = compensator_names(robot)
        joints = tuple(robot.joint_names.index(pull.given.joint) for pull in robot.pulls)
        places = tuple((names.index(one.of), NUMBERS.index(one.component)) for _, one in own)
        return cls(pulls, joints, loaded, places, np.array([i for i, _ in own], dtype=int))

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
            for at, new, old in zip(self.loaded, self.changed(sizes), self.pulls, strict=True):
                x = q[:, at].T
                added[:, at] += (new.loads(x) - old.loads(x)).T
        return added

    def by_numbers(self, sizes: Array, q: Array) -> Array:
        """Derivatives (m, s, c) of these loads by the sizes."""
        found = np.zeros((*q.shape, len(self.places)))
        changed = self.changed(sizes) if len(self.places) else ()
        for i, (which, place) in enumerate(self.places):
            at = self.loaded[which]
            found[:, at, i] = changed[which].loads_by_numbers(q[:, at].T)[place].T
        return found
