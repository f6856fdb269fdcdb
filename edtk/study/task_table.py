"""A path along which the robot shall be accurate, as the keys of a study's table `task`."""

from pydantic import Field

from edtk.study.payload_table import PayloadTable
from edtk.study.table import Table
from edtk.study.test_pose import Lever, Robust
from edtk.study.tool import Load, Tool


class TaskTable(Table):
    """The task as a path: poses and loads in a file, in place of test poses in the study."""

    file: str = Field(
        min_length=1,
        description="Poses of the path, a row each, with their wrenches (CSV, as `edtk compensate` "
        "reads them); path beside the study",
    )
    payload: PayloadTable | None = Field(
        None, description="What the robot carries along the path, besides other loads"
    )
    tool: Tool = Field(description="Tool of the task")
    load: Load | None = Field(
        None, description="Load in every pose; columns of the file take the place of its components"
    )
    robust_deg: Robust = Field(
        0.0, description="Design for all poses whose joints are within this of a pose of it [deg]"
    )
    lever_mm: Lever = Field(
        0.0,
        description="A rotation of the tool counts as the displacement at this distance from the "
        "tool point; 0 if rotations do no harm [mm]",
    )
