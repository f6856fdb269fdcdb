"""What a day of measurements costs, as a study's table `costs`."""

from typing import Annotated

from pydantic import Field

from edtk.study.table import Count, Positive, Table
from edtk.system.finite import Finite
from edtk.system.line import Line


class CostsTable(Table):
    """Costs of visits and of load changes, in any unit, such as minutes.

    A plan costs ``visits * visit + load changes * load_change``. One that visits poses under one
    load alone, or under none, needs no change; one with several loads visits all poses of a load,
    then those of the next one.
    """

    visit: Positive = Field(1.0, description="Cost of a visit of a pose without a load [any unit]")
    loaded_visit: Positive | None = Field(
        None, description="Cost of a visit of a pose under a load; defaults to `visit` [any unit]"
    )
    load_change: Annotated[Finite, Field(ge=0)] = Field(
        0.0, description="Cost of mounting or changing a load in the course of the day [any unit]"
    )
    load_changes: Count | None = Field(
        None,
        description="Load changes of a plan with several loads, where drift asks for more than the "
        "least number; defaults to one fewer than the loads it visits",
    )
    budget: Positive | None = Field(
        None, description="What a plan may cost; decides its size where none is given [any unit]"
    )
    unit: Line = Field("", description='What the costs are counted in, for reports, such as "min"')
