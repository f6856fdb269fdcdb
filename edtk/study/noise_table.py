"""The errors of a tracker, of the robot and of the model, as a study's table `noise`."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator
from pydantic_core import PydanticCustomError

from edtk.model.noise.tracker import Tracker
from edtk.study.table import NotNegative, Positive, Table
from edtk.system.finite import Finite, Vector3
from edtk.system.typing import Array

# Within limits +-MPE, of which nothing else is known, errors are uniform: JCGM 100:2008, 4.3.7.
MPE_OVER_SIGMA = math.sqrt(3)
LEAST_REPEATABLE = 10  # [deg or mm]: no robot that is calibrated comes back worse
TOGETHER = ("tracker_position_mm", "along", "across")

# Trackers with more than a millimetre, or a millimetre a metre, are not sold.
Coefficient = Annotated[Finite, Field(ge=0, le=1e3)]
Coefficients = tuple[Coefficient, Coefficient]


class NoiseTable(Table):
    """Errors that are not white: of a tracker, of joints that repeat, and of the model itself.

    A displacement is the difference of two readings, in each of which tracker and joints err anew.
    """

    tracker_position_mm: Vector3 | None = Field(
        None, description="Where the tracker stands, in the world frame [mm]"
    )
    along: Coefficients | None = Field(
        None,
        description="Error a + b r of one reading along a beam of length r, as [a, b] [um, um/m]",
    )
    across: Coefficients | None = Field(
        None, description="The same for each direction across the beam [um, um/m]"
    )
    given_as: Literal["mpe", "sigma"] = Field(
        "mpe",
        description="What along and across are: largest permissible errors of a data sheet, whose "
        "standard deviation is MPE/sqrt(3), or standard deviations",
    )
    repeatability_deg: tuple[float, ...] = Field(
        (0.0,),
        description="Standard deviation with which a joint comes back, one for all or one per "
        "joint [deg; mm for a prismatic joint]",
    )
    discrepancy_mm: NotNegative = Field(
        0.0,
        description="Standard deviation of what the model leaves out of a displacement, per "
        "marker and coordinate; repeats do not average it out [mm]",
    )
    discrepancy_within_deg: Positive = Field(
        5.0,
        description="Poses nearer than this share their discrepancy, Euclidean over the revolute "
        "joints [deg]",
    )

    @field_validator("repeatability_deg", mode="before")
    @classmethod
    def _each_joint(cls, given: object) -> tuple[float, ...]:
        """One number or a list: a union of types would have errors that nobody reads."""
        numbers = given if isinstance(given, list | tuple) else (given,)
        sound = all(
            isinstance(x, int | float) and not isinstance(x, bool) and 0 <= x <= LEAST_REPEATABLE
            for x in numbers
        )
        if not sound or not numbers:
            raise PydanticCustomError(
                "repeatability",
                "expected a number from 0 to {most}, or a list of them, one per joint",
                {"most": LEAST_REPEATABLE},
            )
        return tuple(numbers)

    @model_validator(mode="after")
    def _whole_tracker(self) -> "NoiseTable":
        given = [key for key in TOGETHER if getattr(self, key) is not None]
        if given and len(given) < len(TOGETHER):
            missing = " and ".join(key for key in TOGETHER if key not in given)
            raise PydanticCustomError(
                "tracker", "expected {missing} too, as a tracker is given", {"missing": missing}
            )
        return self

    @property
    def has_tracker(self) -> bool:
        """Whether a tracker is given."""
        return self.tracker_position_mm is not None

    @property
    def is_white(self) -> bool:
        """Whether the table adds nothing to white noise."""
        return not (self.has_tracker or np.any(self.repeatability_deg) or self.discrepancy_mm)

    def tracker(self) -> Tracker | None:
        """The tracker [m]; None without one."""
        if self.tracker_position_mm is None or self.along is None or self.across is None:
            return None
        divisor = MPE_OVER_SIGMA if self.given_as == "mpe" else 1.0
        along, across = (
            (1e-6 * a / divisor, 1e-6 * b / divisor) for a, b in (self.along, self.across)
        )
        return Tracker(np.array(self.tracker_position_mm) / 1e3, along, across)

    def repeatability(self, factors: Array) -> Array:
        """Standard deviations (n,) of the joints [rad or m].

        Args:
            factors: Units (n,) of the numbers in a file [rad/deg or m/mm].
        """
        return np.array(self.repeatability_deg) * factors

    def describe(self) -> str:
        """The errors in words, for reports; empty if there are none."""
        parts = []
        if self.along is not None and self.across is not None:
            kind = "MPE" if self.given_as == "mpe" else "sigma"
            place = ", ".join(f"{x:g}" for x in self.tracker_position_mm or ())
            parts.append(
                f"tracker at ({place}) mm with {kind} {_sum(self.along)} along and "
                f"{_sum(self.across)} across its beam"
            )
        joints = np.unique(self.repeatability_deg)
        if joints.any():
            span = f"{joints[0]:g}" + (f" to {joints[-1]:g}" if len(joints) > 1 else "")
            parts.append(f"joints repeat within {span} deg")
        if self.discrepancy_mm:
            parts.append(
                f"discrepancy {self.discrepancy_mm:g} mm, shared by poses within "
                f"{self.discrepancy_within_deg:g} deg"
            )
        return ", ".join(parts)


def _sum(coefficients: Coefficients) -> str:
    """``a + b r`` in words."""
    a, b = coefficients
    return f"{a:g} um + {b:g} um/m"
