"""One joint of a serial chain."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from edtk.system.typing import Array

Kind = Literal["revolute", "prismatic"]
UNIT_LENGTH = 8 * np.finfo(float).eps  # rounding of the length of a vector that was normalised


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint of the chain, relative to the frame of the joint before.

    Args:
        name: Name, as used in studies and column headers.
        origin: Transform (4, 4) to the joint's frame at q = 0 [m].
        axis: Axis of positive motion (3,) in that frame; normalised here.
        limits: Lower and upper limit [rad], or [m] for a prismatic joint.
        kind: "revolute" or "prismatic".

    Raises:
        ValueError: The axis is zero, the limits are not in order, or the kind is unknown.
    """

    name: str
    origin: Array
    axis: Array
    limits: tuple[float, float]
    kind: Kind = "revolute"

    def __post_init__(self) -> None:
        axis = np.asarray(self.axis, dtype=float)
        if axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any():
            raise ValueError(
                f"joint {self.name}: the axis must be a non-zero vector of three numbers"
            )
        lower, upper = self.limits
        if not lower < upper:
            raise ValueError(f"joint {self.name}: the lower limit must lie below the upper one")
        if self.kind not in get_args(Kind):
            raise ValueError(
                f"joint {self.name}: kind must be 'revolute' or 'prismatic', not {self.kind!r}"
            )
        length = np.linalg.norm(axis)
        # A second division could move the last digit: a joint that is written and read again
        # has to be the same one.
        if abs(length - 1.0) > UNIT_LENGTH:
            axis = axis / length
        object.__setattr__(self, "axis", axis)
