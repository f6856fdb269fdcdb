"""The keys of a study, each with its unit: checked, and turned into the objects they describe."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from edtk.robots.loads.load import Load as LoadFamily
from edtk.robots.robot_file import ControllerTable
from edtk.study.tables_of_cell import SceneTable, SightTable
from edtk.study.tables_of_measurement import (
    CostsTable,
    DistanceTable,
    MarkerTable,
    MeasurementTable,
    NoiseTable,
    PriorTable,
    SimulationTable,
    UncertaintyTable,
)
from edtk.study.tables_of_robot import (
    NO_SPRINGS,
    JointsTable,
    LoadChoice,
    ParametersTable,
    WorkspaceTable,
)
from edtk.study.tables_of_task import (
    CriterionTable,
    FramesTable,
    GiveUpTable,
    InterestTable,
    PayloadTable,
    TaskTable,
    TestPose,
    TestPoses,
    Tool,
    payload_stands_in,
)
from edtk.system.errors import UserError
from edtk.system.fields import ZERO, Count, Line, Table, Whole, first_error

# The criterion that a study is about gets more descents: its plans are those that people carry out.
MORE_DESCENTS = 4
ACCURACY = "rho0"  # the accuracy in the test pose, for which a calibration is usually made
WITHOUT_A_TEST_POSE = "D"
MOST_CANDIDATES = 10**9  # beyond them no machine would end
ROBOT_FILE = (".toml", ".urdf", ".xacro")  # ends of a file; names of built-in robots have none


def _name_or_table(value: object) -> object:
    """A robot by name or as a table; other values are rejected here, in one line."""
    if not isinstance(value, str | dict):
        raise PydanticCustomError("robot", "expected a name, a path or a table of a robot's keys")
    return value


def _name_of(criterion: object) -> str | None:
    """The name of a criterion that is given as one, or as a table; None without one."""
    found = criterion.get("name") if isinstance(criterion, Mapping) else criterion
    return found if isinstance(found, str) else None


class Specification(Table):
    """All keys of a study, as they are written in its file."""

    title: Line = Field("", description="Title of reports; defaults to one that names the robot")
    robot: Annotated[str | dict[str, Any], BeforeValidator(_name_or_table)] = Field(
        description="Name of a built-in robot, path of a robot file beside the study, or a table "
        "with the keys of a robot file, or with `file`, `coupling` and `compensator` [m, deg or "
        "rad]"
    )
    base_link: str | None = Field(
        None,
        description="Link of a URDF that stands in the world, whose frame is the world's; defaults "
        "to its root",
    )
    tip_link: str | None = Field(
        None,
        description="Link of a URDF in whose frame tools are given; defaults to its leaf, where it "
        "has one only",
    )
    controller: ControllerTable | None = Field(
        None,
        description="How the controller counts the joints; takes the place of that of the robot's "
        "file",
    )
    parameters: ParametersTable | None = Field(
        None,
        description="Geometric errors, base and tool that are unknown, besides compliances or "
        "instead of them; measured positions then tell all at once",
    )
    payload: PayloadTable | None = Field(
        None, description="What the loaded robot carries, besides [load] or instead of it"
    )
    tool: Tool = Field(
        None,
        validate_default=True,
        description="Calibration tool: where the load acts and the marker is; with a payload it "
        "defaults to the frame of the last joint",
    )
    load: LoadChoice | None = Field(
        None,
        validate_default=True,
        description="Loads that a calibration experiment may apply; with a payload there may be "
        "none",
    )
    marker: tuple[MarkerTable, ...] = Field(
        (), description="Markers that are measured, instead of the tool point"
    )
    distance: tuple[DistanceTable, ...] = Field(
        (), description="Distances that are measured, besides markers or instead of them"
    )
    measurement: MeasurementTable = Field(description="Measured quantities and their noise")
    joints: JointsTable = Field(
        description="Unknown and known compliances, and joints that do not move"
    )
    workspace: WorkspaceTable = Field(
        WorkspaceTable(), description="Constraints on the calibration poses"
    )
    test_pose: TestPoses | None = Field(
        None,
        description="The task in which the robot shall be accurate, once or, as `[[test_pose]]`, "
        "several times; rho0 and rho_max need it, or `task`",
    )
    task: TaskTable | None = Field(
        None, description="The task as the file of a path, in place of test poses"
    )
    frames: FramesTable = Field(
        FramesTable(), description="Tools and bases that robot programs name, to correct programs"
    )
    interest: InterestTable | None = Field(
        None,
        description="The compliances that all criteria but rho0 and rho_max are about; by default "
        "all that are unknown",
    )
    criterion: CriterionTable | None = Field(
        None,
        description="The criterion that the study is about, by name or, with its parameters, as "
        "`{ name = 'I', points = [[...]] }`; see `edtk criteria`. It is optimised first",
    )
    give_up: GiveUpTable | None = Field(
        None,
        description="A second criterion of `edtk plan`, and how much of the first one it may cost; "
        "`--for` and `--give-up` take its place",
    )
    criteria: Annotated[tuple[str, ...], Field(min_length=1)] = Field(
        (), description="Criteria under which plans are compared; default to the optimised ones"
    )
    optimise: Annotated[tuple[str, ...], Field(min_length=1)] = Field(
        (),
        description="Criteria for which plans are searched; default to rho0 with a test pose, "
        "else, or with `interest`, to D",
    )
    sizes: Annotated[tuple[Count, ...], Field(min_length=1)] = Field(
        (4,), description="Numbers of experiments for which plans are searched"
    )
    candidates: Annotated[Whole, Field(ge=1, le=MOST_CANDIDATES)] = Field(
        2000, description="Number of feasible poses that a relaxation begins with"
    )
    sampling: Literal["random", "sobol"] = Field(
        "random", description="How candidate poses are drawn"
    )
    starts: Count = Field(
        64,
        description="Descents of `edtk run` per plan, at most; four times as many for the "
        "criterion that the study is about",
    )
    seed: Annotated[Whole, Field(ge=0)] = Field(0, description="Seed of everything that is drawn")
    published: tuple[str, ...] = Field(
        (), description="Plans (CSV) to compare with; paths beside the study"
    )
    simulation: SimulationTable | None = Field(
        None, description="The truth that simulated measurements assume"
    )
    prior: PriorTable = Field(PriorTable(), description="Knowledge before the measurements")
    noise: NoiseTable | None = Field(
        None, description="Errors that are not white: of a tracker, of the joints, of the model"
    )
    sight: SightTable | None = Field(
        None,
        description="What the instrument sees: how far, where, and through which cameras; a marker "
        "that is not seen in a pose has no rows there",
    )
    costs: CostsTable | None = Field(
        None,
        description="What visits and load changes cost, and what a plan may cost",
    )
    uncertainty: UncertaintyTable = Field(
        UncertaintyTable(), description="How well the circumstances of a calibration are known"
    )
    scene: SceneTable | None = Field(
        None,
        description="The cell: what stands around the robot and what it carries, which must not "
        "touch",
    )

    @model_validator(mode="before")
    @classmethod
    def _default_criteria(cls, given: Any) -> Any:
        """Fill in `optimise` and `criteria`, which depend on other keys."""
        if not isinstance(given, Mapping):
            return given
        # With a task rho0 is what matters, unless somebody says that certain compliances do.
        has_task = any(given.get(key) is not None for key in ("test_pose", "task"))
        main = ACCURACY if has_task and given.get("interest") is None else WITHOUT_A_TEST_POSE
        named = _name_of(given.get("criterion"))
        filled = {"optimise": (main if named is None else named,), **given}
        if named is not None and named not in (optimised := filled["optimise"]):
            if not isinstance(optimised, list | tuple):
                return given  # which is rejected elsewhere
            filled["optimise"] = (named, *optimised)
        if isinstance(given.get("parameters"), Mapping):
            filled |= _with_geometry(given)
        return {"criteria": filled["optimise"], **filled}

    # A payload needs neither a load nor a tool.
    _without_a_load = field_validator("tool", "load", mode="before")(payload_stands_in)

    @field_validator("criteria", "optimise", "sizes")
    @classmethod
    def _once_each(cls, given: tuple[object, ...]) -> tuple[object, ...]:
        for entry in given:
            if given.count(entry) > 1:
                raise PydanticCustomError(
                    "twice", "{entry} is listed twice", {"entry": repr(entry)}
                )
        return given

    def build_load(self) -> LoadFamily:
        """The wrenches of an experiment: those of [load], or the weight of the payload."""
        if self.load is not None:
            return self.load.build()
        assert self.payload is not None
        return self.payload.build()

    def describe_load(self) -> str:
        """What loads an experiment, in words."""
        parts = (self.load, self.payload)
        return ", ".join(part.describe() for part in parts if part is not None)

    @property
    def test_poses(self) -> tuple[TestPose, ...]:
        """All test poses that stand in the study itself."""
        if self.test_pose is None:
            return ()
        return (self.test_pose,) if isinstance(self.test_pose, TestPose) else self.test_pose

    @property
    def robot_file(self) -> str | None:
        """Path of the robot's file, as it is written; None for a built-in robot and a table."""
        name = self.robot_name
        return name if name is not None and name.endswith(ROBOT_FILE) else None

    @property
    def robot_name(self) -> str | None:
        """Name of a built-in robot, or path of a file; None where the robot is a table."""
        name = self.robot if isinstance(self.robot, str) else self.robot.get("file")
        return name if isinstance(name, str) else None

    @property
    def main_criterion(self) -> str:
        """Name of the criterion that the study is about: `criterion`, rho0, or the first."""
        if self.criterion is not None:
            return self.criterion.name
        return ACCURACY if ACCURACY in self.optimise else self.optimise[0]

    def descents(self, criterion: str) -> int:
        """Number of descents, at most, of a search for one plan under a criterion."""
        return self.starts * (MORE_DESCENTS if criterion == self.main_criterion else 1)


def _with_geometry(given: Mapping[str, Any]) -> dict[str, Any]:
    """The joints and markers of a study of geometry, whose keys may be left out."""
    parameters = given["parameters"]
    joints = given.get("joints")
    joints = {} if joints is None else joints
    markers = given.get("marker")
    filled: dict[str, Any] = {}
    if isinstance(joints, Mapping):
        compliance = parameters.get("compliance")
        unknown = () if compliance is None else compliance
        filled["joints"] = {"unknown": unknown, **joints}
    if isinstance(markers, list | tuple) and all(isinstance(one, Mapping) for one in markers):
        filled["marker"] = [{"position_mm": ZERO, **one} for one in markers]
    return filled


def read_specification(content: Mapping[str, Any], where: str) -> Specification:
    """Check the keys of a study.

    Args:
        content: The keys, as plain numbers, strings, lists and tables.
        where: File, or other place, that messages name.

    Raises:
        UserError: One line that names the place, the key and what was expected.
    """
    try:
        geometry = isinstance(content.get("parameters"), Mapping)
        return Specification.model_validate(content, context={NO_SPRINGS: geometry})
    except ValidationError as error:
        key, message = first_error(error, Specification)
        raise UserError(message, where=where, key=key or None) from None


def describe_noise(specification: Specification) -> str:
    """White noise, then the errors of [noise]; commas between them."""
    measurement = specification.measurement
    sizes = []
    if measurement.sigma_mm is not None:
        sizes.append(f"{measurement.sigma_mm:g} mm")
    if measurement.sigma_deg is not None and measurement.rows == "pose":
        sizes.append(f"{measurement.sigma_deg:g} deg")
    white = f"sigma = {' and '.join(sizes)}" if sizes else ""
    other = "" if specification.noise is None else specification.noise.describe()
    return ", ".join(filter(None, (white, other)))
