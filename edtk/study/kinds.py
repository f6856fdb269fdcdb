"""The kinds of studies: of compliances alone, and of geometry with springs or without.

What differs between them is here; `kind_of` alone asks which one a study is of.
"""

from collections.abc import Sequence

import numpy as np

import criteria
from edtk.fit.correlated_noise import row_numbers
from edtk.fit.marker_positions import read_positions
from edtk.measure.parameters import Parameter, all_parameters
from edtk.measure.pose_table import (
    SHEET_COLUMNS,
    VISIT_COLUMN,
    PoseTable,
    Table,
    finished_rows,
    path_of,
)
from edtk.measure.task import Tasks
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.robots.robot import Robot
from edtk.study.asked import Asked
from edtk.study.plausibility import doubtful_noise, idle_axes
from edtk.study.schema import Specification
from edtk.study.study_model import (
    BASE,
    absolute_task_weights,
    compensator_numbers,
    instrument_kinds,
    is_reference,
    marker_names,
    on_robot,
    other_springs,
    task_weights,
)
from edtk.study.study_objects import Kind, StudyObjects, firsts
from edtk.study.study_parts import TaskDefaults
from edtk.study.tables_of_robot import ParametersTable
from edtk.study.tables_of_task import InterestTable
from edtk.system.errors import UserError, note
from edtk.system.typing import Array


def kind_of(specification: Specification) -> Kind:
    """The kind of a study, by its keys."""
    return Compliances() if specification.parameters is None else Geometry()


class Compliances(Kind):
    """Compliances alone are unknown, and displacements under loads are measured."""

    key = "joints.unknown"
    # A payload hangs at the last joint's frame, and needs no tool.
    task = TaskDefaults(task_weights, tool=np.eye(4), wrench=None)
    hard_to_believe = (doubtful_noise, idle_axes)

    def unknowns(self, study: Asked) -> str:
        """How many compliances."""
        return _counted(study)

    def bodies(self, robot: Robot) -> tuple[str, ...]:
        """Those of the robot: a displacement does not see the base."""
        return robot.body_names

    def check(self, study: Asked) -> None:
        """Check what is of geometry, and that test poses have a tool, and a load."""
        if study.specification.prior.parameters:
            message = "is for studies with [parameters]; expected prior.joints"
            raise study.error("prior.parameters", message)
        if study.specification.task is not None and study.specification.task.tool is None:
            raise study.error("task.tool", "this key is required")
        # rho0 has no meaning where errors of compliances do no harm.
        for i, pose in enumerate(study.specification.test_poses):
            if pose.payload is not None:
                continue
            for key in ("tool", "load"):
                if getattr(pose, key) is None:
                    raise study.error(f"{study.key_of(i)}.{key}", "this key is required")
            if pose.load is not None and not any((*pose.load.F_N, *pose.load.T_Nm)):
                raise study.error(
                    f"{study.key_of(i)}.load",
                    "a test pose without load has nothing to compensate; expected a load",
                )

    def is_paired(self, study: Asked) -> bool:
        """Displacements are those from the pose without the load, unless they are absolute."""
        return not study.is_absolute

    def check_interest(self, study: StudyObjects, table: InterestTable) -> None:
        """Check joints and combinations, and that some criterion can be about them."""
        if table.parameters:
            message = "is for studies with [parameters]; expected joints or combinations"
            raise study.error("interest.parameters", message)
        _check_joints(study, "interest.joints", table.joints)
        for i, factors in enumerate(table.combinations):
            _check_joints(study, f"interest.combinations[{i + 1}]", tuple(factors))
            _check_units(study, f"interest.combinations[{i + 1}]", factors)
        assert study.interest is not None
        depends = False
        for key in ("optimise", "criteria"):
            for name in getattr(study.specification, key):
                if criteria.get(name).needs_target or not criteria.get(name).takes_interest:
                    continue
                depends = True
                try:
                    study.criterion(name)
                except UserError as error:
                    whose = "interest" if error.message.startswith("interest") else key
                    raise study.error(whose, error.message.removeprefix("interest: ")) from error
        if not depends:
            message = (
                "no criterion of the study depends on it, as the test pose says what these are "
                'about; expected another criterion too, such as optimise = ["D"]'
            )
            raise study.error("interest", message)

    def check_criterion(self, study: StudyObjects, key: str, name: str) -> None:
        """Check that a criterion has the parameters that it needs, and that they fit."""
        table = study.specification.criterion
        is_given = table is not None and table.name == name
        if not is_given and not criteria.get(name).needs_parameters:
            return
        try:
            # Numbers whose squares overflow are found by what comes of them.
            with np.errstate(all="ignore"):
                criterion = study.criterion(name)
                identity = np.eye(len(study.unknown))
                if not criterion.needs_target and not np.isfinite(criterion.cost(identity)):
                    raise ValueError("no finite cost")
        except UserError as error:
            raise study.error("criterion" if is_given else key, error.message) from error
        except (criteria.CriterionError, ValueError, TypeError, ArithmeticError) as error:
            message = (
                f"criterion {name!r}: its parameters do not fit {len(study.unknown)} compliances"
            )
            raise study.error("criterion", message) from error

    def require_compliances_alone(self, study: Asked) -> None:
        """Nothing else is unknown."""

    def parameters(self, study: Asked) -> ParametersTable:
        """There are none."""
        raise study.error("parameters", "expected a study of geometry, with a table [parameters]")

    def wrench_of_pose(self, study: Asked) -> Array | None:
        """The study's only load; None where it has several, at one place."""
        load = study.specification.build_load()
        if isinstance(load, FixedLoad):
            return load.always
        return np.full(9, np.nan) if _several_places(study) else None

    def visits(
        self, study: Asked, path: Table, table: PoseTable, made: bool
    ) -> tuple[Array, Array]:
        """The first rows of each visit."""
        table = table.with_known(study.robot, SHEET_COLUMNS)
        table = finished_rows(table) if made else table
        q = table.poses(study.robot, study.fixed)
        wrench = table.wrenches(self.wrench_of_pose(study))
        if VISIT_COLUMN in table:
            visit = row_numbers(q, wrench, table.numbers(VISIT_COLUMN)[:, None])
            q, wrench = firsts(visit, q, wrench)
        return q, wrench

    def target(self, tasks: Tasks) -> Array | None:
        """That of the tasks."""
        return tasks.target

    def interest(self, table: InterestTable, unknown: Sequence[str]) -> Array | None:
        """Joints and combinations."""
        return table.build(unknown)


class Geometry(Kind):
    """Geometry, base and tools are unknown, springs too if asked for; positions are measured."""

    key = "parameters"
    task = TaskDefaults(absolute_task_weights, tool=None, wrench=np.zeros(6))
    keeps_loads = True

    def unknowns(self, study: Asked) -> str:
        """Geometry, and how many compliances."""
        count = len(other_springs(study))
        more = f"{count} other spring{'s' if count > 1 else ''}" if count else ""
        springs = [_counted(study) if study.unknown else "", more]
        return " and ".join(filter(None, ("geometry", *springs)))

    def bodies(self, robot: Robot) -> tuple[str, ...]:
        """Those of the robot, and the base, which shows whether the instrument moved."""
        return (*robot.body_names, BASE)

    def check(self, study: Asked) -> None:
        """Check that the unknowns are of this robot, and that positions of the tool are measured.

        Raises:
            UserError: One line that names the study, the key and what was expected.
        """
        given = study.specification
        asked = self.parameters(study)
        unknown = given.joints.unknown
        compliance = asked.compliance
        own = [name for name in unknown if name not in (compliance or ())] if asked.springs else []
        if compliance is not None and (*compliance, *own) != unknown:
            raise study.error(
                "joints.unknown",
                "differs from parameters.compliance; expected the same joints, or one of both keys",
            )
        for name in unknown:
            if name not in study.robot.joint_names:
                names = ", ".join(study.robot.joint_names)
                raise study.error(
                    "parameters.compliance", f"no joint {name!r}; this robot has {names}"
                )
        try:
            chosen = all_parameters(study.robot, (), asked.geometry, (), asked.base, False)
        except ValueError as error:
            raise study.error("parameters.geometry", str(error)) from error
        _check_compensators(study)
        unknown_loads = (*unknown, *asked.springs, *asked.compensators)
        if not chosen and not asked.tool and not unknown_loads:
            raise study.error(
                "parameters", "leaves nothing unknown; expected geometry, base or tool"
            )
        _check_reference(study, asked.base)
        _check_measured(study)
        _check_unused(study)
        self._check_prior(study)

    def is_paired(self, study: Asked) -> bool:
        """Positions are absolute, unless the study asks for changes under a load."""
        measurement = study.specification.measurement
        return measurement.reference == "unloaded" and "reference" in measurement.model_fields_set

    def check_interest(self, study: StudyObjects, table: InterestTable) -> None:
        """Check names of parameters, of which geometry has more than compliances."""
        if table.joints or table.combinations:
            key = "interest.joints" if table.joints else "interest.combinations"
            raise study.error(
                key, "a study with [parameters] names what is of interest in `parameters`"
            )
        every = self._every(study)
        for name in table.parameters:
            if not any(name in one.groups for one in every):
                known = ", ".join(dict.fromkeys(one.groups[-1] for one in every))
                raise study.error(
                    "interest.parameters",
                    f"no parameter {name!r} is asked for; expected some of {known}, of kinds, "
                    f"joints, or single ones such as {every[-1].name}",
                )

    def _every(self, study: Asked) -> tuple[Parameter, ...]:
        """The parameters that the study asks for."""
        asked = self.parameters(study)
        return all_parameters(
            study.robot,
            tuple(name for _, name in on_robot(study)) or ("marker",),
            asked.geometry,
            study.specification.joints.unknown,
            asked.base,
            asked.tool,
            study.specification.measurement.rows == "pose",
            others=(*other_springs(study), *compensator_numbers(study)),
        )

    def _check_prior(self, study: Asked) -> None:
        """Check that what is known of the geometry is of parameters that the study asks for."""
        every = self._every(study)
        for name, known in study.specification.prior.parameters.items():
            key = f"prior.parameters.{name}"
            meant = [one for one in every if name in one.groups]
            if not meant:
                listed = ", ".join(dict.fromkeys(one.groups[-1] for one in every))
                raise study.error(
                    key,
                    f"no parameter {name!r} is asked for; expected one of {listed}, a kind, a "
                    f"joint, or a single one such as {every[-1].name}",
                )
            if meant[0].is_spring:
                own = meant[0].name.removeprefix("k_")
                raise study.error(key, f"expected it in prior.joints.{own}")
            if meant[0].place == "base":
                raise study.error(
                    key,
                    "the base's errors are about the place that the sheet itself gives it, of "
                    "which nothing can be known before; expected other parameters",
                )
            turns = {one.turns for one in meant}
            numbers = {"std_mrad": (True, known.std_mrad), "std_mm": (False, known.std_mm)}
            given = {key: turn for key, (turn, std) in numbers.items() if std is not None}
            idle = [key for key, turn in given.items() if turn not in turns]
            # Of a group, lengths and angles are given together.
            if idle and (len(meant) == 1 or len(idle) == len(given)):
                other = "std_mm" if idle == ["std_mrad"] else "std_mrad"
                raise study.error(key, f"means no {idle[0][4:]}; expected {other}")

    def check_criterion(self, study: StudyObjects, key: str, name: str) -> None:
        """The parameters of a plan are known only when it is asked for."""

    def require_compliances_alone(self, study: Asked) -> None:
        """More is unknown."""
        raise study.error(
            "parameters", "this knows compliances alone; expected a study without [parameters]"
        )

    def parameters(self, study: Asked) -> ParametersTable:
        """Those of the table."""
        table = study.specification.parameters
        assert table is not None
        return table

    def wrench_of_pose(self, study: Asked) -> Array | None:
        """None at all."""
        return np.zeros(9 if _several_places(study) else 6)

    def visits(
        self, study: Asked, path: Table, table: PoseTable, made: bool
    ) -> tuple[Array, Array]:
        """Visits in which any marker was, or is to be, measured."""
        kinds = instrument_kinds(study)
        data = read_positions(path, study.robot, study.fixed, kinds, measured=False)
        if not made:
            return data.q, data.wrench
        seen = data.seen.any(axis=1)
        if not seen.any():
            raise UserError("no position of a marker is filled in", where=path_of(path))
        if not seen.all():
            note(f"{int(seen.sum())} of {len(data)} visits are filled in", path_of(path))
        return data.q[seen], data.wrench[seen]

    def target(self, tasks: Tasks) -> Array | None:
        """That of its own parameters, see `edtk.geometry_problem`."""
        return None

    def interest(self, table: InterestTable, unknown: Sequence[str]) -> Array | None:
        """Names of parameters say it."""
        return None


def _counted(study: Asked) -> str:
    """How many compliances are unknown."""
    count = len(study.unknown)
    return f"{count} unknown compliance{'s' if count > 1 else ''}"


def _check_joints(study: Asked, key: str, names: tuple[str, ...]) -> None:
    unknown = study.specification.joints.unknown
    for name in names:
        if name not in unknown:
            message = f"{name!r} is no unknown joint; expected {', '.join(unknown)}"
            raise study.error(key, message)


def _check_units(study: Asked, key: str, factors: dict[str, float]) -> None:
    """Compliances of joints that turn and of joints that slide are no numbers of one kind."""
    robot = study.robot
    kinds = {robot.joints[robot.joint_names.index(name)].kind for name, f in factors.items() if f}
    if len(kinds) > 1:
        raise study.error(
            key, "adds compliances of a revolute and of a prismatic joint; expected one unit"
        )


def _check_measured(study: Asked) -> None:
    """Markers and distances on the robot, and reference points on the base."""
    given = study.specification
    full = given.measurement.rows == "pose"
    if full and not given.marker:
        raise study.error("marker", "expected one with a name, whose poses are measured")
    tracked = given.noise is not None and given.noise.has_tracker
    if given.measurement.sigma_mm is None and not tracked:
        raise study.error(
            "measurement.sigma_mm",
            "expected, the standard deviation of a coordinate [mm], or a tracker in [noise]",
        )
    for i, marker in enumerate(given.marker):
        if is_reference(study, marker) and marker.rows == "pose":
            message = "points on the base have positions alone; expected 'position'"
            raise study.error(f"marker.{i}.rows", message)
    on_base = [
        name
        for one, name in zip(given.marker, marker_names(study), strict=True)
        if is_reference(study, one)
    ]
    for i, distance in enumerate(given.distance):
        if distance.marker in on_base or distance.joint == BASE:
            raise study.error(
                f"distance.{i}",
                "no robot moves a point on the base; expected one on the robot",
            )
    if given.marker and len(on_base) == len(given.marker) and not given.distance:
        raise study.error("marker", "expected one on the robot besides those on the base")


def _check_compensators(study: Asked) -> None:
    """Numbers of compensators are of this robot, and their joints give way."""
    key = "parameters.compensators"
    try:
        asked = compensator_numbers(study)
    except ValueError as error:
        raise study.error(key, str(error)) from error
    joints = study.specification.joints
    for one in asked:
        joint = one.of.partition(":")[0]
        if joint not in (*joints.unknown, *joints.known):
            raise study.error(
                key,
                f"joint {joint} counts as rigid, so that nothing shows its compensator; expected "
                "its compliance among the unknown or the known ones",
            )


def _check_reference(study: Asked, base: bool) -> None:
    """What a reading is measured from says something of what is asked for."""
    given = study.specification
    reference = given.measurement.reference
    is_stated = "reference" in given.measurement.model_fields_set
    if reference == "nominal" and base:
        raise study.error(
            "measurement.reference",
            "displacements from the nominal robot ask where that stands; expected base = false",
        )
    springs = given.joints.unknown or other_springs(study)
    if reference == "unloaded" and is_stated and not springs:
        raise study.error(
            "measurement.reference",
            "what a load changes tells compliances alone, and none is asked for; expected "
            "parameters.compliance, or 'instrument'",
        )


def _check_unused(study: Asked) -> None:
    """Keys that a calibration of geometry would not heed are refused, not passed over."""
    given = study.specification
    unused = {
        "prior.sigma_factor": given.prior.sigma_factor != 1,
        "prior.nu": given.prior.nu != "normal",
    }
    instead = {
        "prior.sigma_factor": "the size of its errors is fitted anyway",
        "prior.nu": "--robust gives errors heavy tails",
    }
    for key, is_given in unused.items():
        if is_given:
            raise study.error(key, f"a study of geometry does not heed this key; {instead[key]}")


def _several_places(study: Asked) -> bool:
    """Whether the loads of a study act at several places."""
    load = study.specification.load
    return load is not None and load.list_at_mm is not None
