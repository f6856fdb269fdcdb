"""A joint that follows another one, as fingers of a gripper or the bars of a parallelogram do."""

from dataclasses import dataclass

import numpy as np

from edtk.model.joint import Joint, Kind
from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class TiedJoint:
    """A joint of a chain whose variable is ``factor q_master + offset``.

    The tie is a mechanism: a joint that follows has no motor and no spring of its own, and the
    spring of its master gives way to what loads both.

    Args:
        name: Its name.
        origin: Transform (4, 4) to the joint's frame at q = 0 [m].
        axis: Axis of positive motion (3,) in that frame.
        kind: "revolute" or "prismatic".
        place: Its index in the chain, in which joints that follow are counted too.
        master: Name of the joint that it follows, which follows none.
        factor: Motion of this joint for one unit of the master's, not zero.
        offset: Its variable where the master's is zero [rad or m].

    Raises:
        ValueError: The factor is zero, or a number is none.
    """

    name: str
    origin: Array
    axis: Array
    kind: Kind
    place: int
    master: str
    factor: float
    offset: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.factor) and np.isfinite(self.offset) and self.factor):
            raise ValueError(
                f"joint {self.name}: follows {self.master} with the factor {self.factor:g} and the "
                f"offset {self.offset:g}; expected numbers, and a factor that is not zero"
            )

    def joint(self, master: Joint) -> Joint:
        """The joint, whose limits are those that it has where the master is at its own."""
        ends = sorted(self.factor * limit + self.offset for limit in master.limits)
        return Joint(self.name, self.origin, self.axis, (ends[0], ends[1]), self.kind)
