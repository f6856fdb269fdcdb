"""The limits of joints in the controller's values."""

from dataclasses import dataclass

import numpy as np

from edtk.model.robot import Robot


@dataclass(frozen=True)
class ShownLimit:
    """A joint's range as a person reads it at the controller.

    The limits are those of the model's joint. A joint that follows another one has them for a sum:
    ``q_3 = s (c_3 - z_3 + f (c_2 - z_2))`` between l and u bounds ``c_3 + f c_2``.

    Attributes:
        label: What is bounded: "q3", or "q3 + q2" for a joint that follows.
        sign: 1, or -1 if the controller counts the other way round.
        offset: Value at the model's zero [rad or m].
    """

    label: str
    sign: float
    offset: float

    def of(self, value: float) -> float:
        """The controller's value for one of the model's joint variable [rad or m]."""
        return self.offset + self.sign * value

    def range(self, limits: tuple[float, float]) -> tuple[float, float]:
        """Lower and upper limit at the controller for those of the model [rad or m]."""
        first, second = map(self.of, limits)
        return (first, second) if self.sign > 0 else (second, first)


def shown_limits(robot: Robot) -> tuple[ShownLimit, ...]:
    """How the limits of each joint are to be read at the controller."""
    controller = robot.controller
    if controller is None:
        return tuple(ShownLimit(name, 1.0, 0.0) for name in robot.joint_names)
    zero = np.asarray(controller.zero * controller.units)
    found = []
    for j, name in enumerate(robot.joint_names):
        label = name
        offset = float(zero[j])
        for one in controller.follows:
            if one.joint == j:
                size = "" if abs(one.factor) == 1 else f"{abs(one.factor):g} "
                label += f" {'+' if one.factor > 0 else '-'} {size}{robot.joint_names[one.leader]}"
                offset += float(one.factor * zero[one.leader])
        found.append(ShownLimit(label, float(controller.sign[j]), offset))
    return tuple(found)
