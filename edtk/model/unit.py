"""The units in which people read lengths and angles."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Unit:
    """A unit of people, and how it relates to the SI unit that the program computes with.

    Attributes:
        name: As printed: "mm".
        per_si: How many of it are one SI unit: 1e3.
    """

    name: str
    per_si: float


METRE = Unit("m", 1.0)
MILLIMETRE = Unit("mm", 1e3)
DEGREE = Unit("deg", 180 / np.pi)
