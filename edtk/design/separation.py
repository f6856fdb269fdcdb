"""Whether a plan would tell two faults of the calibration apart."""

from dataclasses import dataclass
from typing import Any

from edtk.design.detection import Detection
from edtk.system.typing import Array

ENOUGH = 0.9  # probability of the right name that repetitions are to reach


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
