"""Tables of a study about its purpose: tools, test poses, paths, criteria, what is of interest."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
    model_validator,
)
from pydantic_core import PydanticCustomError

from criteria.named_interest import named_parameters
from edtk.programs.targets.reading import Frames
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.robots.rotations import transform
from edtk.robots.weights import GRAVITY
from edtk.system.fields import ZERO, Finite, Positive, Table, Vector3, listed
from edtk.system.typing import Array

GIVEN_UP = 5.0  # [%] of a criterion for a second one, where nobody says how much


class Tool(Table):
    """Tool frame after the last joint, or after the flange: the tip link of a URDF."""

    position_mm: Vector3 = Field(
        description="Tool point in the last joint's frame, or in a URDF's tip link [mm]"
    )
    rpy_deg: Vector3 = Field(
        ZERO, description="Roll, pitch and yaw about the fixed axes of that frame [deg]"
    )

    def build(self) -> Array:
        """Transform (4, 4) [m]."""
        return transform(np.array(self.position_mm) / 1e3, np.deg2rad(self.rpy_deg))


class Load(Table):
    """Wrench at the tool point, in the world frame."""

    F_N: Vector3 = Field(description="Force, in world axes at the tool point [N]")
    T_Nm: Vector3 = Field(ZERO, description="Torque, in world axes [N m]")

    def build(self) -> Array:
        """Wrench (6,) [N, N m]."""
        return np.array([*self.F_N, *self.T_Nm])


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


def payload_stands_in(given: Any, info: ValidationInfo) -> Any:
    """Take a given tool or load; where there is none, a payload needs neither, nor does geometry.

    Args:
        given: The value of `tool` or `load`; None if the key is left out.
        info: The name of the key, and the keys before it, of which `payload` is one.

    Returns:
        The given value. Without one: the frame of the last joint for a tool, and no load.

    Raises:
        PydanticCustomError: Neither the key nor a payload is given.
    """
    if given is not None:
        return given
    # Absolute positions need no load, and find the tool.
    if all(info.data.get(key) is None for key in ("payload", "parameters")):
        raise PydanticCustomError("missing", "this key is required")
    return Tool(position_mm=ZERO) if info.field_name == "tool" else None


class FramesTable(Table):
    """Frames that robot programs name, and where the controller's own ones are.

    Only `edtk compensate` of a program reads them.
    """

    flange: Tool = Field(
        Tool(position_mm=ZERO),
        description="The controller's flange, in the frame in which `tool.position_mm` is given; "
        "tools of programs begin there",
    )
    world: Tool = Field(
        Tool(position_mm=ZERO),
        description="The controller's world, in the world of the robot's model; bases of programs "
        "begin there",
    )
    tool: dict[str, Tool] = Field(
        {},
        description="Tools by the names or numbers that programs have for them; `default` is that "
        "of poses before which a program states none",
    )
    base: dict[str, Tool] = Field({}, description="Bases, user frames or work objects, likewise")

    def build(self) -> Frames:
        """Transforms [m]."""
        return Frames(
            flange=self.flange.build(),
            world=self.world.build(),
            tools={name: one.build() for name, one in self.tool.items()},
            bases={name: one.build() for name, one in self.base.items()},
        )


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
    tool: Tool | None = Field(
        None,
        description="Tool of the task; with a payload it defaults to the frame of the last joint. "
        "With `parameters` it may be left out: then the markers count, and no tool point",
    )
    load: Load | None = Field(
        None,
        description="Load of the task; with a payload, and with `parameters`, there may be none",
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


def _form(given: object) -> str:
    """Whether one test pose is given, or several."""
    return ":several" if isinstance(given, list | tuple) else ":one"


# The tags keep an error in one form from being told as an error in the other one.
TestPoses = Annotated[
    Annotated[TestPose, Tag(":one")]
    | Annotated[tuple[TestPose, ...], Field(min_length=1), Tag(":several")],
    Discriminator(_form),
]


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
    tool: Tool | None = Field(
        None, description="Tool of the task; with `parameters` it may be left out, see `test_pose`"
    )
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


class CriterionTable(BaseModel):
    """The criterion that the study is about, with the parameters that it needs."""

    # Parameters are those of the criterion, which plug-ins extend; the criterion checks them.
    model_config = ConfigDict(extra="allow", frozen=True)

    name: str = Field(description="Name of the criterion, see `edtk criteria`")

    @model_validator(mode="before")
    @classmethod
    def _name_alone(cls, given: Any) -> Any:
        """A name stands for a table that holds nothing else."""
        if isinstance(given, str):
            return {"name": given}
        if not isinstance(given, Mapping | CriterionTable):
            raise PydanticCustomError("criterion", "expected a name, or a table with a name")
        return given

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters as they are written."""
        return dict(self.model_extra or {})

    def build(self, unknown: Sequence[str]) -> dict[str, Any]:
        """The parameters as `criteria.create` takes them.

        Args:
            unknown: Names (p,) of the joints whose compliances are unknown.

        Raises:
            ValueError: A joint is not among them; the line names it.
        """
        return named_parameters(self.parameters, unknown, "unknown joint")


class GiveUpTable(Table):
    """A second criterion, for which plans give up a part of the one that the study is about."""

    criterion: str | dict[str, Any] = Field(
        description="The second criterion: its name, a table with its parameters, or names of "
        "parameters, apart by commas, for Ds of these"
    )
    percent: Annotated[Finite, Field(gt=0, lt=100)] = Field(
        GIVEN_UP, description="How much of the first one may be given up [%]"
    )


class InterestTable(Table):
    """The compliances that criteria are about; the others are unknown too, but do no harm."""

    joints: Annotated[tuple[str, ...], BeforeValidator(listed)] = Field(
        (), description="Joints whose compliances are of interest; each is one of `joints.unknown`"
    )
    combinations: tuple[dict[str, Finite], ...] = Field(
        (),
        description="Linear combinations of compliances that are of interest, each as factors by "
        "joint: `[{ q2 = 1, q3 = -1 }]` for the difference of two [-]",
    )

    parameters: Annotated[tuple[str, ...], BeforeValidator(listed)] = Field(
        (),
        description="For a study with `parameters`, which of them are of interest: 'geometry', "
        "'compliance', 'base', 'tool', joints ('q2': the six errors of the frame before it), kinds "
        "('zeros', 'lengths', 'tilts') or single ones ('q2.rx', 'k_q2')",
    )

    @model_validator(mode="after")
    def _something(self) -> "InterestTable":
        if not self.joints and not self.combinations and not self.parameters:
            raise PydanticCustomError("interest", "expected joints or combinations")
        return self

    def build(self, unknown: Sequence[str]) -> Array:
        """Combinations K (p, s), one a column: those of single joints first.

        Args:
            unknown: Names (p,) of the joints whose compliances are unknown.
        """
        factors = [*({name: 1.0} for name in self.joints), *self.combinations]
        return np.array([[each.get(name, 0.0) for each in factors] for name in unknown])
