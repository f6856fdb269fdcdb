"""How well the circumstances of a calibration are known, as a study's table `uncertainty`."""

from typing import Annotated

from pydantic import Field

from edtk.study.table import Compliance, Table
from edtk.system.finite import Finite

NotNegative = Annotated[Finite, Field(ge=0)]


class UncertaintyTable(Table):
    """Standard deviations of what a calibration takes as given, besides the noise."""

    load_percent: NotNegative = Field(1.0, description="Size of the calibration load [%]")
    load_direction_deg: Annotated[Finite, Field(ge=0, le=90)] = Field(
        1.0, description="Direction of the calibration load, about each axis across it [deg]"
    )
    tool_mm: NotNegative = Field(
        1.0, description="Calibration tool point and marker, along each axis [mm]"
    )
    drift_mm: NotNegative = Field(
        0.0, description="Shift between unloaded and loaded readings that all share, per axis [mm]"
    )
    repeatability_mm: NotNegative = Field(
        0.0, description="Motion of the robot between the two readings of one visit, per axis [mm]"
    )
    rigid_rad_per_Nm: dict[str, Compliance] = Field(
        {},
        description="Compliance that a joint may have which counts as rigid, by joint; defaults to "
        "the median of the other joints' [rad/(N m)]",
    )
