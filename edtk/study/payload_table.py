"""A payload that loads the robot by its weight, as a study's table `payload`."""

from typing import Annotated

import numpy as np
from pydantic import Field

from edtk.model.dead_weights import GRAVITY
from edtk.model.loads.fixed_load import FixedLoad
from edtk.study.table import Positive, Table
from edtk.system.finite import ZERO, Vector3
from edtk.system.typing import Array


class PayloadTable(Table):
    """What the loaded robot carries; its weight acts at the centre of mass, along -z of the world.

    It loads a calibration experiment by itself, or besides `[load]`.
    """

    mass_kg: Annotated[Positive, Field(le=1e5)] = Field(description="Mass [kg]")
    center_mm: Vector3 = Field(
        ZERO,
        description="Centre of mass, in the frame in which `tool.position_mm` is given [mm]",
    )

    @property
    def center(self) -> Array:
        """Centre of mass (3,) in the frame in which tools are given [m]."""
        return np.array(self.center_mm) / 1e3

    def build(self) -> FixedLoad:
        """The weight as a wrench at the centre of mass [N]."""
        return FixedLoad(np.array([0.0, 0.0, -GRAVITY * self.mass_kg, 0.0, 0.0, 0.0]))

    def describe(self) -> str:
        """The payload in words, for reports."""
        center = ", ".join(f"{component:g}" for component in self.center_mm)
        return f"payload of {self.mass_kg:g} kg at ({center}) mm"
