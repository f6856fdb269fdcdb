"""The checks of a study that need its robot and the criteria, beyond those of single keys."""

import numpy as np

import criteria
from edtk.robots.compensator import SAMPLES
from edtk.robots.robot import Beyond, Robot, shown_limits
from edtk.study.check_measured import check_markers, check_noise
from edtk.study.schema import Specification
from edtk.study.study_objects import StudyObjects
from edtk.study.study_parts import check_limits
from edtk.study.study_sight import check_sight

# Displacement of the tool by 1 rad/(N m) below which a load turns no joint: what rounding leaves.
LEAST_HARM = 1e-9  # [m]
LIMIT = 1e-9  # [rad or m] beyond a limit that the conversion of degrees leaves
KEY_OF_KIND = {"revolute": "fixed_deg", "prismatic": "fixed_mm"}


def check_tasks(study: StudyObjects) -> None:
    """Check that a study's tasks make sense for its robot.

    Raises:
        UserError: One line that names the study or the file of the path, the key and what was
            expected.
    """
    specification = study.specification
    if specification.task is not None and specification.test_pose is not None:
        raise study.error("task", "expected one of [test_pose] and [task], the study has both")
    for i, pose in enumerate(specification.test_poses):
        key = study.key_of(i)
        if len(pose.q_deg) != study.robot.n:
            raise study.error(
                f"{key}.q_deg",
                f"has {len(pose.q_deg)} entries, expected {study.robot.n}, one per joint",
            )
    if not study.tasks:
        return
    _check_weights(study)
    if specification.task is None:
        check_limits(study, np.array([task.q for task in study.tasks]))
    # Geometry has no such target: it is in error in every pose, whatever the load turns.
    if study.target is not None and np.abs(study.target).max() < LEAST_HARM:
        where = "in the test pose" if len(study.tasks) == 1 else "in any of the test poses"
        raise study.error(
            "test_pose.load" if specification.task is None else "task.load",
            f"the load turns no joint of joints.unknown {where}, so that there is nothing "
            "to compensate; expected another load, tool or pose",
        )


def _check_weights(study: StudyObjects) -> None:
    if not any(task.weight for task in study.tasks):
        raise study.error(
            f"{study.key_of(0)}.weight",
            "the weights of all test poses are 0; expected one above it",
        )


def check_study(study: StudyObjects) -> None:
    """Check that the keys of a study fit its robot, each other and the criteria that there are.

    Raises:
        UserError: One line that names the study, the key and what was expected.
    """
    specification = study.specification
    study.kind.check(study)
    _check_joint_names(study, specification, study.robot)
    _check_fixed_joints(study, specification, study.robot)
    _check_measurement(study, specification)
    check_markers(study)
    check_noise(study)
    check_sight(study, study.sight)
    _check_compensators(study)
    _check_home(study)
    _check_speeds(study)
    check_tasks(study)
    _check_criteria(study, specification)
    if specification.interest is not None:
        study.kind.check_interest(study, specification.interest)


def _check_home(study: StudyObjects) -> None:
    """The home pose has a number for each joint, within its limits."""
    scene = study.specification.scene
    if scene is None or scene.home_deg is None:
        return
    if len(scene.home_deg) != study.robot.n:
        message = f"has {len(scene.home_deg)} entries, expected {study.robot.n}, one per joint"
        raise study.error("scene.home_deg", message)
    assert study.home is not None
    beyond = np.flatnonzero(study.robot.bounds.excess(study.home) > LIMIT)
    if len(beyond):
        found = Beyond.of(study.robot, study.home, int(beyond[0]))
        low, high = found.limits
        message = f"{found.name} = {found.value:g} is outside its limits {low:g} .. {high:g}"
        raise study.error("scene.home_deg", message)


def _check_speeds(study: StudyObjects) -> None:
    """Speeds by name are of joints that there are, in their own unit."""
    costs = study.specification.costs
    kinds = {joint.name: joint.kind for joint in study.robot.joints}
    for key, kind in (("speed_deg_per_s", "revolute"), ("speed_mm_per_s", "prismatic")):
        given = None if costs is None else getattr(costs, key)
        for name in given if isinstance(given, dict) else ():
            if kinds.get(name) != kind:
                those = [one for one, own in kinds.items() if own == kind]
                has = ", ".join(those) if those else "none"
                message = f"no {kind} joint {name!r}; this robot has {has}"
                raise study.error(f"costs.{key}", message)


def _check_joint_names(study: StudyObjects, specification: Specification, robot: Robot) -> None:
    for key in ("unknown", "known_rad_per_Nm", "fixed_deg", "fixed_mm"):
        for name in getattr(specification.joints, key):
            if name not in robot.joint_names:
                names = ", ".join(robot.joint_names)
                follows = {tied.name: tied.masters for tied in robot.tied}
                what = f"no joint {name!r}"
                if name.partition(".")[0] in robot.joint_names:
                    what += " ([parameters] springs asks for springs across joints and for laws)"
                if name in follows:
                    masters = " and ".join(map(repr, follows[name]))
                    what = f"joint {name!r} follows {masters} and has no spring of its own"
                raise study.error(f"joints.{key}", f"{what}; this robot has {names}")
    for name in specification.joints.known_rad_per_Nm:
        if name in specification.joints.unknown:
            raise study.error(
                f"joints.known_rad_per_Nm.{name}",
                "the joint is among joints.unknown too; expected it in one of them",
            )


def _check_fixed_joints(study: StudyObjects, specification: Specification, robot: Robot) -> None:
    """Fixed values are given in the joint's own unit, and lie within its limits."""
    for key in KEY_OF_KIND.values():
        for name in getattr(specification.joints, key):
            kind = robot.joints[robot.joint_names.index(name)].kind
            if key != KEY_OF_KIND[kind]:
                message = f"the joint is {kind}; give its value in {KEY_OF_KIND[kind]}"
                raise study.error(f"joints.{key}.{name}", message)
    _check_fixed_leaders(study, robot)
    q = np.array([study.fixed.get(j, 0.0) for j in range(robot.n)])
    moving = np.delete(robot.bounds.rows, list(study.fixed), axis=1).any(axis=1)
    for row in np.flatnonzero((robot.bounds.excess(q) > 0) & ~moving):
        joint = robot.joints[robot.bounds.of[row]]
        key = f"joints.{KEY_OF_KIND[joint.kind]}.{joint.name}"
        raise study.error(key, "the value is outside the joint's limits")


def _check_fixed_leaders(study: StudyObjects, robot: Robot) -> None:
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


def _check_compensators(study: StudyObjects) -> None:
    """No compensator takes more stiffness than a joint of the guessed compliance has."""
    gives = study.model.gives
    if gives is None:
        return
    robot = study.robot
    for pull in gives.pulls:
        j = robot.joint_names.index(pull.given.joint)
        fixed = study.fixed.get(j)
        lower, upper = robot.limits[:, j] if fixed is None else (fixed, fixed)
        q = np.linspace(lower, upper, SAMPLES)
        taken = pull.derivative(q)
        k = float(gives.compliances[j])
        worst = int(taken.argmax())
        if k * taken[worst] >= 1:
            at = shown_limits(robot)[j].of(float(q[worst])) / robot.units[j]
            raise study.error(
                "robot.compensator",
                f"the arm would snap at {pull.given.joint} = {at:.4g} deg: the compensator takes "
                f"{taken[worst]:.3g} N m/rad there from a spring of {1 / k:.3g}, as [simulation], "
                "[prior] or known compliances say; expected other numbers, or limits without it",
            )


def _check_measurement(study: StudyObjects, specification: Specification) -> None:
    unknown = specification.joints.unknown
    if len(set(unknown)) < len(unknown):
        raise study.error("joints.unknown", "a joint is named twice")


def _check_criteria(study: StudyObjects, specification: Specification) -> None:
    # `criteria` defaults to `optimise`, so a wrong name in both is reported where it was written.
    for key in ("optimise", "criteria"):
        for name in getattr(specification, key):
            try:
                criterion = criteria.get(name)
            except criteria.CriterionError as error:
                raise study.error(key, str(error)) from error
            study.kind.check_criterion(study, key, name)
            if criterion.needs_target and not study.tasks:
                raise study.error(key, f"criterion {name!r} needs a [test_pose], and there is none")
            if key == "optimise" and not issubclass(criterion, criteria.Relaxable):
                raise study.error(
                    key,
                    f"criterion {name!r} has no convex form to optimise; it can only be compared",
                )
