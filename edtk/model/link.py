"""The body that one joint moves: its mass, and where that mass is."""

from dataclasses import dataclass

import numpy as np

from edtk.system.typing import Array


@dataclass(frozen=True, eq=False)
class Link:
    """The body that a joint moves, up to the next joint, as far as gravity knows it.

    Args:
        mass: Mass, zero for a body without weight [kg].
        center: Centre of mass (3,) in the frame of the joint that moves the body [m].

    Raises:
        ValueError: The mass is negative or no number, or the centre is no point.
    """

    mass: float
    center: Array

    def __post_init__(self) -> None:
        if not (np.isfinite(self.mass) and self.mass >= 0):
            raise ValueError(f"the mass is {self.mass:g} kg; expected a number from 0 on")
        center = np.asarray(self.center, dtype=float)
        if center.shape != (3,) or not np.isfinite(center).all():
            raise ValueError("the centre of mass must be a point of three numbers")
        object.__setattr__(self, "mass", float(self.mass))
        object.__setattr__(self, "center", center)
