"""What is measured and how well, as a study's table `measurement`."""

from typing import Literal

from pydantic import Field

from edtk.study.table import Sigma, Table


class MeasurementTable(Table):
    """Measured quantities and their noise, which is that of a difference of two readings."""

    rows: Literal["position", "pose"] = Field(
        "position", description="Measured rows: the marker's position, or its rotation too"
    )
    sigma_mm: Sigma | None = Field(
        None,
        description="Standard deviation of a displacement, per coordinate; needed unless [noise] "
        "has a tracker, whose errors it adds to [mm]",
    )
    sigma_deg: Sigma | None = Field(
        None, description="Standard deviation of a rotation, per axis; for rows = 'pose' [deg]"
    )
    reference: Literal["unloaded", "nominal"] = Field(
        "unloaded",
        description="What a displacement is measured from: the unloaded robot, which bends under "
        "the weight of its links too, or where the rigid robot of the model would be",
    )
