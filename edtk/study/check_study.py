"""The checks of a study that need its robot and the criteria, beyond those of single keys."""

from typing import TYPE_CHECKING

import numpy as np

import criteria
from edtk.model.robot import Robot
from edtk.study.check_interest import check_interest
from edtk.study.check_markers import check_markers
from edtk.study.check_noise import check_noise
from edtk.study.check_parameters import check_parameters
from edtk.study.check_tasks import check_tasks
from edtk.study.schema import Specification
from edtk.system.errors import UserError

if TYPE_CHECKING:
    from edtk.study.study import Study

KEY_OF_KIND = {"revolute": "fixed_deg", "prismatic": "fixed_mm"}


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
