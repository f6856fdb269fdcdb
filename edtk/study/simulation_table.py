"""What simulated measurements assume, as a study's table `simulation`."""

from pydantic import Field

from edtk.study.table import Compliance, Table


class SimulationTable(Table):
    """The truth that simulated measurements assume."""

    compliance_rad_per_Nm: dict[str, Compliance] = Field(
        description="Compliance of each unknown joint, by name [rad/(N m)]"
    )
