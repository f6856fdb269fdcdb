"""Gravity compensators, by the places of their anchors, and how joints give way with them."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from edtk.certificate.recompute.chain import Chain
from edtk.certificate.recompute.plain_data import number, numbers, rows, table, text, whole
from edtk.system.typing import Array

KEYS = ("pull", "joint", "anchors", "stiffness", "preload")
MOST_COMPENSATORS = 64
WHERE = "setting.gives"


@dataclass(frozen=True, eq=False)
class Pull:
    """A coil spring or a gas cylinder across a joint.

    Attributes:
        kind: "coil" or "gas".
        joint: Index of the joint among all, which is a free one.
        anchors: On the body before the joint, and on the one behind it (2, 3), in the frame of the
            joint at zero [m].
        stiffness: Slope of the force by the distance, at zero [N/m].
        preload: Force at zero [N].
    """

    kind: str
    joint: int
    anchors: Array
    stiffness: float
    preload: float

    @classmethod
    def from_dict(cls, content: Any, n: int, where: str) -> "Pull":
        """Read a compensator of a robot with n joints.

        Raises:
            ValueError: It is none.
        """
        content = table(content, KEYS, where)
        return cls(
            text(content["pull"], ("coil", "gas"), f"{where}.pull"),
            whole(content["joint"], 0, n - 1, f"{where}.joint"),
            numbers(content["anchors"], (2, 3), f"{where}.anchors"),
            number(content["stiffness"], f"{where}.stiffness"),
            number(content["preload"], f"{where}.preload"),
        )

    def changed(self, number: int, change: float) -> "Pull":
        """The same with a change of one of its numbers.

        They are six coordinates of the anchors [m], the stiffness [N/m] and the preload [N].
        """
        anchors = self.anchors.copy()
        if number < anchors.size:
            anchors.flat[number] += change
            return replace(self, anchors=anchors)
        if number == anchors.size:
            return replace(self, stiffness=self.stiffness + change)
        return replace(self, preload=self.preload + change)

    def on(self, chain: Chain, q: Array) -> tuple[Array, Array]:
        """Load (k, n) of the free joints, and its slope (k, n) by the joint itself.

        The anchor behind the joint turns with it. It is pulled along the line to the other one, by
        a force whose moment about the axis is the load.
        """
        axis = chain.axes[self.joint]
        turned, u, length, force, slope = self._pulling(chain, q)
        velocity = np.cross(axis, turned)
        lever = (u * velocity).sum(axis=1)
        inward = (u * np.cross(axis, velocity)).sum(axis=1)
        bent = ((velocity**2).sum(axis=1) - lever**2) / length + inward
        load, by_joint = np.zeros((2, *q.shape))
        at = chain.free.index(self.joint)
        load[:, at] = -force * lever
        by_joint[:, at] = -(slope * lever**2 + force * bent)
        return load, by_joint

    def along(self, chain: Chain, q: Array, end: int) -> Array:
        """Load (k,) of a shift along an axis of the joint's frame (0 to 2), or of a turn (3 to 5).

        These move what the joint carries against the body before.
        """
        turned, u, _, force, _ = self._pulling(chain, q)
        axis = np.eye(3)[end % 3]
        moved = axis if end < len(axis) else np.cross(axis, turned)
        return np.asarray(-force * (u * moved).sum(axis=1))

    def _pulling(self, chain: Chain, q: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Anchor behind the joint (k, 3), direction there, distance, force, slope of the force."""
        angle = q[:, chain.free.index(self.joint), None]
        axis = chain.axes[self.joint]
        fixed, point = self.anchors
        along = (point @ axis) * axis
        aside = np.cross(axis, point)
        turned = along + np.cos(angle) * (point - along) + np.sin(angle) * aside
        line = turned - fixed
        length = np.linalg.norm(line, axis=1)
        longer = length - np.linalg.norm(point - fixed)
        force = self.preload + self.stiffness * longer
        slope = np.full_like(force, self.stiffness)
        if self.kind == "gas":
            room = 1 - self.stiffness * longer / self.preload
            force = self.preload / room
            slope = self.stiffness / room**2
        return turned, line / length[:, None], length, force, slope


@dataclass(frozen=True, eq=False)
class Gives:
    """By how much less joints with compensators give way, about a guess of their compliances.

    Attributes:
        pulls: The compensators.
        compliances: The guess (n,) [rad/(N m)].
    """

    pulls: list[Pull]
    compliances: Array

    @classmethod
    def from_dict(cls, content: Any, chain: Chain) -> "Gives":
        """Read the part `setting.gives` of a certificate.

        Raises:
            ValueError: A part is missing, or is not what it should be.
        """
        content = table(content, ("pulls", "compliances"), WHERE)
        given = rows(content["pulls"], MOST_COMPENSATORS, f"{WHERE}.pulls")
        pulls = [
            Pull.from_dict(one, len(chain.axes), f"{WHERE}.pulls[{i}]")
            for i, one in enumerate(given)
        ]
        if any(one.joint not in chain.free for one in pulls):
            raise ValueError(f"{WHERE}.pulls: expected joints that follow no other")
        return cls(pulls, numbers(content["compliances"], (chain.n,), f"{WHERE}.compliances"))

    def factors(self, chain: Chain, q: Array) -> Array:
        """``1 / (1 - k dtau/dq)`` (k, n): of what turns such a joint, that much is left."""
        slopes = np.zeros_like(q)
        for pull in self.pulls:
            slopes += pull.on(chain, q)[1]
        return np.asarray(1 / (1 - self.compliances * slopes))
