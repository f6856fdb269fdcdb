"""The checks of a study that need its robot and the criteria, beyond those of single keys."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import criteria
from edtk.measure.parameters import all_parameters
from edtk.measure.pose_table import pose_factors
from edtk.robots.robot import Robot, shown_limits
from edtk.study.check_measured import check_markers, check_noise
from edtk.study.schema import Specification
from edtk.study.study_model import is_reference, on_robot
from edtk.study.tables_of_task import InterestTable
from edtk.system.errors import UserError
from edtk.system.typing import Array

if TYPE_CHECKING:
    from edtk.study.study import Study
    from edtk.study.study_objects import StudyObjects

# Displacement of the tool by 1 rad/(N m) below which a load turns no joint: what rounding leaves.
LEAST_HARM = 1e-9  # [m]
ROUNDING = 1e-9  # by how much a joint may be beyond its limits [rad or m]
KEY_OF_KIND = {"revolute": "fixed_deg", "prismatic": "fixed_mm"}


def check_interest(study: "Study") -> None:
    """Check that what is of interest makes sense, and that the criteria can be about it.

    Raises:
        UserError: One line that names the study, the key and what was expected.
    """
    table = study.specification.interest
    if table is None:
        return
    if study.specification.parameters is not None:
        _check_names_of_interest(study, table)
        return
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
            "no criterion of the study depends on it, as the test pose says what these are about; "
            'expected another criterion too, such as optimise = ["D"]'
        )
        raise study.error("interest", message)


def _check_names_of_interest(study: "Study", table: InterestTable) -> None:
    """Names of parameters, of which a study of geometry has more than compliances."""
    if table.joints or table.combinations:
        key = "interest.joints" if table.joints else "interest.combinations"
        raise study.error(
            key, "a study with [parameters] names what is of interest in `parameters`"
        )
    asked = study.specification.parameters
    assert asked is not None
    every = all_parameters(
        study.robot,
        tuple(name for _, name in on_robot(study)) or ("marker",),
        asked.geometry,
        study.specification.joints.unknown,
        asked.base,
        asked.tool,
    )
    for name in table.parameters:
        if not any(name in one.groups for one in every):
            known = ", ".join(dict.fromkeys(one.groups[-1] for one in every))
            raise study.error(
                "interest.parameters",
                f"no parameter {name!r} is asked for; expected some of {known}, of kinds, joints, "
                f"or single ones such as {every[-1].name}",
            )


def _check_joints(study: "Study", key: str, names: tuple[str, ...]) -> None:
    unknown = study.specification.joints.unknown
    for name in names:
        if name not in unknown:
            message = f"{name!r} is no unknown joint; expected {', '.join(unknown)}"
            raise study.error(key, message)


def _check_units(study: "Study", key: str, factors: dict[str, float]) -> None:
    """Compliances of joints that turn and of joints that slide are no numbers of one kind."""
    robot = study.robot
    kinds = {robot.joints[robot.joint_names.index(name)].kind for name, f in factors.items() if f}
    if len(kinds) > 1:
        raise study.error(
            key, "adds compliances of a revolute and of a prismatic joint; expected one unit"
        )


def check_parameters(study: "StudyObjects") -> None:
    """Check that the unknowns are of this robot, and that positions of the tool are measured.

    Raises:
        UserError: One line that names the study, the key and what was expected.
    """
    given = study.specification
    if given.parameters is None:
        if given.costs is not None:
            raise study.error(
                "costs", "plans of compliances alone do not heed it; expected [parameters] too"
            )
        return
    unknown = given.joints.unknown
    compliance = given.parameters.compliance
    if compliance is not None and tuple(compliance) != unknown:
        raise study.error(
            "joints.unknown",
            "differs from parameters.compliance; expected the same joints, or one of both keys",
        )
    for name in unknown:
        if name not in study.robot.joint_names:
            names = ", ".join(study.robot.joint_names)
            raise study.error("parameters.compliance", f"no joint {name!r}; this robot has {names}")
    try:
        chosen = all_parameters(
            study.robot, (), given.parameters.geometry, (), given.parameters.base, False
        )
    except ValueError as error:
        raise study.error("parameters.geometry", str(error)) from error
    if not chosen and not given.parameters.tool and not unknown:
        raise study.error("parameters", "leaves nothing unknown; expected geometry, base or tool")
    _check_measured(study)
    _check_unused(study)


def _check_measured(study: "StudyObjects") -> None:
    """Positions of markers on the tool, and reference points on the base, and nothing else."""
    given = study.specification
    if given.distance:
        raise study.error("distance", "a study of geometry knows no distances; expected markers")
    full = given.measurement.rows == "pose"
    if full and not given.marker:
        raise study.error("marker", "expected one with a name, whose poses are measured")
    if given.measurement.reference != "unloaded":
        raise study.error(
            "measurement.reference",
            "positions of a study of geometry are absolute anyway; leave the key out",
        )
    if given.measurement.sigma_mm is None:
        raise study.error(
            "measurement.sigma_mm", "expected, the standard deviation of a coordinate [mm]"
        )
    for i, marker in enumerate(given.marker):
        if is_reference(study, marker):
            if marker.rows == "pose":
                message = "points on the base have positions alone; expected 'position'"
                raise study.error(f"marker.{i}.rows", message)
        elif marker.rows not in (None, given.measurement.rows):
            message = "expected that of measurement.rows for all markers on the tool"
            raise study.error(f"marker.{i}.rows", message)
        if marker.joint is not None and not is_reference(study, marker):
            raise study.error(
                f"marker.{i}.joint",
                "markers of a study of geometry sit on the tool, or on the 'base' as references",
            )
    if given.marker and all(is_reference(study, marker) for marker in given.marker):
        raise study.error("marker", "expected one on the tool besides those on the base")


def _check_unused(study: "StudyObjects") -> None:
    """Keys that a calibration of geometry would not heed are refused, not passed over."""
    given = study.specification
    noise = given.noise
    unused = {
        "joints.known_rad_per_Nm": bool(given.joints.known_rad_per_Nm),
        "noise.tracker_position_mm": noise is not None and noise.has_tracker,
        "task": given.task is not None,
        "prior": given.prior != type(given.prior)(),
    }
    for i, pose in enumerate(given.test_poses):
        key = "test_pose" if len(given.test_poses) == 1 else f"test_pose.{i}"
        unused[f"{key}.robust_deg"] = bool(pose.robust_deg)
        unused[f"{key}.lever_mm"] = bool(pose.lever_mm)
        unused[f"{key}.payload"] = pose.payload is not None
    instead = {
        "joints.known_rad_per_Nm": "list the joint in parameters.compliance",
        "noise.tracker_position_mm": "give measurement.sigma_mm",
        "task": "give test poses",
        "prior": "its estimate rests on the positions alone",
    }
    for key, is_given in unused.items():
        if is_given:
            why = instead.get(key, "give more test poses, with a load each")
            raise study.error(key, f"a study of geometry does not heed this key; {why}")


def check_tasks(study: "Study") -> None:
    """Check that a study's tasks make sense for its robot.

    Raises:
        UserError: One line that names the study or the file of the path, the key and what was
            expected.
    """
    specification = study.specification
    if specification.task is not None and specification.test_pose is not None:
        raise study.error("task", "expected one of [test_pose] and [task], the study has both")
    for i, pose in enumerate(specification.test_poses):
        key = key_of(study, i)
        if len(pose.q_deg) != study.robot.n:
            raise study.error(
                f"{key}.q_deg",
                f"has {len(pose.q_deg)} entries, expected {study.robot.n}, one per joint",
            )
        # rho0 has no meaning where errors of compliances do no harm; those of the geometry do.
        if (
            specification.parameters is None
            and pose.payload is None
            and not any((*pose.load.F_N, *pose.load.T_Nm))
        ):
            raise study.error(
                f"{key}.load", "a test pose without load has nothing to compensate; expected a load"
            )
    if not study.tasks:
        return
    _check_weights(study)
    if specification.task is None:
        check_limits(study, np.array([task.q for task in study.tasks]))
    if specification.parameters is not None:
        return  # the geometry is in error in every pose, whatever the load turns
    if study.target is not None and np.abs(study.target).max() < LEAST_HARM:
        where = "in the test pose" if len(study.tasks) == 1 else "in any of the test poses"
        raise study.error(
            "test_pose.load" if specification.task is None else "task.load",
            f"the load turns no joint of joints.unknown {where}, so that there is nothing "
            "to compensate; expected another load, tool or pose",
        )


def key_of(study: "StudyObjects", index: int) -> str:
    """The key of a test pose, as messages name it."""
    return "test_pose" if len(study.specification.test_poses) == 1 else f"test_pose.{index}"


def _check_weights(study: "Study") -> None:
    if not any(task.weight for task in study.tasks):
        raise study.error(
            f"{key_of(study, 0)}.weight",
            "the weights of all test poses are 0; expected one above it",
        )


def check_limits(study: "StudyObjects", q: Array) -> None:
    """Check that the robot can take all poses (t, n): the test poses, or the rows of a path.

    Raises:
        UserError: It cannot take one of them; names it.
    """
    lower, upper = study.robot.hard_limits
    outside = (q < lower - ROUNDING) | (q > upper + ROUNDING)
    if outside.any():
        i = int(outside.any(axis=1).argmax())
        joints = np.flatnonzero(outside[i])
        raise _beyond(study, i, q[i], joints[0], len(joints) - 1)


def _beyond(study: "StudyObjects", index: int, q: Array, j: int, more: int) -> UserError:
    """The error of a pose that is beyond a joint's limits, as the controller shows them."""
    lower, upper = study.robot.limits
    shown = shown_limits(study.robot)[j]
    limits = shown.range((lower[j], upper[j]))
    factor = pose_factors(study.robot)[j]
    low, value, high = np.array([limits[0], shown.of(q[j]), limits[1]]) / factor
    others = f", and {more} more" if more else ""
    message = (
        f"the robot cannot take this pose: joint {shown.label} is at {value:.6g}, beyond its "
        f"limits {low:.6g} .. {high:.6g}{others}"
    )
    given = study.specification.task
    if given is None:
        return study.error(f"{key_of(study, index)}.q_deg", message)
    return UserError(message, where=Path(study.folder / given.file), key=f"row {index + 1}")


def check_study(study: "Study") -> None:
    """Check that the keys of a study fit its robot, each other and the criteria that there are.

    Raises:
        UserError: One line that names the study, the key and what was expected.
    """
    specification = study.specification
    check_parameters(study)
    _check_joint_names(study, specification, study.robot)
    _check_fixed_joints(study, specification, study.robot)
    _check_measurement(study, specification)
    check_markers(study)
    check_noise(study)
    check_tasks(study)
    _check_criteria(study, specification)
    check_interest(study)


def _check_joint_names(study: "Study", specification: Specification, robot: Robot) -> None:
    for key in ("unknown", "known_rad_per_Nm", "fixed_deg", "fixed_mm"):
        for name in getattr(specification.joints, key):
            if name not in robot.joint_names:
                names = ", ".join(robot.joint_names)
                follows = {tied.name: tied.master for tied in robot.tied}
                what = f"no joint {name!r}"
                if name in follows:
                    what = f"joint {name!r} follows {follows[name]!r} and has no spring of its own"
                raise study.error(f"joints.{key}", f"{what}; this robot has {names}")
    for name in specification.joints.known_rad_per_Nm:
        if name in specification.joints.unknown:
            raise study.error(
                f"joints.known_rad_per_Nm.{name}",
                "the joint is among joints.unknown too; expected it in one of them",
            )


def _check_fixed_joints(study: "Study", specification: Specification, robot: Robot) -> None:
    """Fixed values are given in the joint's own unit, and lie within its limits."""
    for key in KEY_OF_KIND.values():
        for name in getattr(specification.joints, key):
            kind = robot.joints[robot.joint_names.index(name)].kind
            if key != KEY_OF_KIND[kind]:
                message = f"the joint is {kind}; give its value in {KEY_OF_KIND[kind]}"
                raise study.error(f"joints.{key}.{name}", message)
    _check_fixed_leaders(study, robot)
    for j, value in study.fixed.items():
        joint = robot.joints[j]
        low, high = robot.hard_limits[:, j]
        if not low <= value <= high:
            key = f"joints.{KEY_OF_KIND[joint.kind]}.{joint.name}"
            raise study.error(key, "the value is outside the joint's limits")


def _check_fixed_leaders(study: "Study", robot: Robot) -> None:
    """A joint that follows another one stays where it is only if that one does."""
    if robot.controller is None:
        return
    for j in study.fixed:
        for leader in robot.controller.leaders(j):
            if leader not in study.fixed:
                joint = robot.joints[j]
                name = robot.joint_names[leader]
                raise study.error(
                    f"joints.{KEY_OF_KIND[joint.kind]}.{joint.name}",
                    f"the joint follows {name}, which moves, and so would it; expected {name} "
                    "among the fixed joints too, or neither of them",
                )


def _check_measurement(study: "Study", specification: Specification) -> None:
    unknown = specification.joints.unknown
    if len(set(unknown)) < len(unknown):
        raise study.error("joints.unknown", "a joint is named twice")


def _check_parameters(study: "Study", key: str, name: str) -> None:
    """A criterion has the parameters that it needs, and they fit the unknown compliances."""
    if study.specification.parameters is not None:
        return  # the parameters of a plan are known only when it is asked for
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
        message = f"criterion {name!r}: its parameters do not fit {len(study.unknown)} compliances"
        raise study.error("criterion", message) from error


def _check_criteria(study: "Study", specification: Specification) -> None:
    # `criteria` defaults to `optimise`, so a wrong name in both is reported where it was written.
    for key in ("optimise", "criteria"):
        for name in getattr(specification, key):
            try:
                criterion = criteria.get(name)
            except criteria.CriterionError as error:
                raise study.error(key, str(error)) from error
            _check_parameters(study, key, name)
            if criterion.needs_target and not study.tasks:
                raise study.error(key, f"criterion {name!r} needs a [test_pose], and there is none")
            if key == "optimise" and not issubclass(criterion, criteria.Relaxable):
                raise study.error(
                    key,
                    f"criterion {name!r} has no convex form to optimise; it can only be compared",
                )
