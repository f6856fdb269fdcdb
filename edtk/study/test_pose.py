"""Where the robot shall be accurate, as the keys of a table `test_pose` of a study."""

from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag, ValidationInfo, field_validator

from edtk.study.payload_stands_in import payload_stands_in
from edtk.study.payload_table import PayloadTable
from edtk.study.table import Table
from edtk.study.tool import Load, Tool
from edtk.system.finite import ZERO, Finite

Robust = Annotated[Finite, Field(ge=0, le=180)]
Lever = Annotated[Finite, Field(ge=0, le=1e6)]


class TestPose(Table):
    """The task: the pose and load in which the robot shall be accurate."""

    __test__ = False  # so that pytest does not collect the class because of its name

    q_deg: tuple[Finite, ...] = Field(
        description="Joint variables, one per joint [deg; mm for a prismatic joint]"
    )
    payload: PayloadTable | None = Field(
        None, description="What the robot carries in the task, besides `load` or instead of it"
    )
    tool: Tool = Field(
        None,
        validate_default=True,
        description="Tool of the task; with a payload it defaults to the frame of the last joint",
    )
    load: Load = Field(
        None,
        validate_default=True,
        description="Load of the task; with a payload there may be none",
    )
    robust_deg: Robust = Field(
        0.0,
        description="Design for all poses whose joints are within this of the test pose: rho0 is "
        "the root mean square over them; a prismatic joint moves by the share robust_deg / 360 of "
        "its range [deg]",
    )
    lever_mm: Lever = Field(
        0.0,
        description="A rotation of the tool counts as the displacement at this distance from the "
        "tool point; 0 if rotations do no harm [mm]",
    )
    weight: Annotated[Finite, Field(ge=0)] = Field(
        1.0,
        description="How much the pose counts beside others; one of weight 0 is only reported [-]",
    )

    @field_validator("tool", "load", mode="before")
    @classmethod
    def _without_a_load(cls, given: Any, info: ValidationInfo) -> Any:
        """A payload needs neither a load nor a tool."""
        return payload_stands_in(given, info, no_load=Load(F_N=ZERO))


def _form(given: object) -> str:
    """Whether one test pose is given, or several."""
    return ":several" if isinstance(given, list | tuple) else ":one"


# The tags keep an error in one form from being told as an error in the other one.
TestPoses = Annotated[
    Annotated[TestPose, Tag(":one")]
    | Annotated[tuple[TestPose, ...], Field(min_length=1), Tag(":several")],
    Discriminator(_form),
]
