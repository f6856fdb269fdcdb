"""Whether a plan would notice a fault of the calibration, and tell it from another."""

from dataclasses import dataclass
from typing import Any

from edtk.system.typing import Array

FALSE_ALARM = 0.01  # probability of a false alarm
ROUNDING_OF_PROBABILITY = 1e-4  # of a probability
ENOUGH = 0.9  # probability of the right name that repetitions are to reach


@dataclass(frozen=True, eq=False)
class Detection:
    """The chance that a fault of some size is noticed.

    Attributes:
        fault: Name of the fault.
        size: Its size, in `unit`.
        unit: Unit of the size.
        power: Probability that the measurements of the plan show the fault, by a test whose false
            alarms have the probability `FALSE_ALARM`.
        better: Joint variables (n,) of one more experiment that shows it best [rad or m]; None
            where none helps.
        power_with: The probability with that experiment.
        joint: The joint that the fault is in; empty if it is in none.
    """

    fault: str
    size: float
    unit: str
    power: float
    better: Array | None
    power_with: float
    joint: str = ""

    @property
    def never(self) -> bool:
        """Whether no measurement shows the fault: the test has its false alarms, and no others."""
        return self.power_with <= self.power <= FALSE_ALARM + ROUNDING_OF_PROBABILITY

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON; joint variables in radians and metres."""
        return {
            "fault": self.fault,
            "size": self.size,
            "unit": self.unit,
            "joint": self.joint or None,
            "power": self.power,
            "better_q": None if self.better is None else self.better.tolist(),
            "power_with": self.power_with,
        }


@dataclass(frozen=True, eq=False)
class Separation:
    """The chance that of two faults the right one is named.

    Attributes:
        faults: The two faults, with the chances that each is noticed.
        right: Probability that the right one is named, where it is one of these two and both are
            equally likely; a half is chance.
        better: Joint variables (n,) of one more experiment that tells them apart best [rad or m];
            None where none helps.
        right_with: The probability with that experiment.
        times: How often each experiment has to be measured until the right one is named with
            `ENOUGH`; None if a hundred times are not enough, or repetitions share their noise.
    """

    faults: tuple[Detection, Detection]
    right: float
    better: Array | None
    right_with: float
    times: int | None

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON; joint variables in radians and metres."""
        return {
            "faults": [detection.fault for detection in self.faults],
            "right": self.right,
            "better_q": None if self.better is None else self.better.tolist(),
            "right_with": self.right_with,
            "times": self.times,
        }
