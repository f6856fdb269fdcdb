"""The robot of a study: named, in a file, or a table of the study."""

from pathlib import Path

from edtk.model.load_robot import load_robot
from edtk.model.robot import Robot
from edtk.model.robot_from_dict import RobotFileError, robot_from_dict
from edtk.study.schema import Specification
from edtk.system.errors import UserError

KEY_OF_KIND = {"revolute": "limits_deg", "prismatic": "limits_mm"}
LINKS = ("base_link", "tip_link")


def study_robot(keys: Specification, folder: Path, where: str) -> Robot:
    """Find the robot of a study, with the limits that the study has in place of its own.

    Args:
        keys: The keys of the study.
        folder: Folder to which the path of a robot's file is relative.
        where: The study, for messages.

    Raises:
        UserError: One line that names the study, the key and what was expected.
    """
    try:
        robot = _found(keys, folder)
    except RobotFileError as error:
        if error.key in LINKS:
            message = error.message if error.where is None else f"{error.where} {error.message}"
            raise UserError(message, where=where, key=error.key) from error
        if error.key == "limits":
            raise UserError(str(error.message), where=where, key=_limits_key(keys)) from error
        raise UserError(str(error), where=where, key="robot") from error
    for kind, key in KEY_OF_KIND.items():
        for name in getattr(keys.joints, key):
            joint = robot.joints[robot.joint_names.index(name)]
            if joint.kind != kind:
                message = f"the joint is {joint.kind}; give its limits in {KEY_OF_KIND[joint.kind]}"
                raise UserError(message, where=where, key=f"joints.{key}.{name}")
    return robot


def _found(keys: Specification, folder: Path) -> Robot:
    limits = keys.joints.limits()
    if isinstance(keys.robot, str):
        return load_robot(keys.robot, folder, base=keys.base_link, tip=keys.tip_link, limits=limits)
    for key in LINKS:
        if getattr(keys, key) is not None:
            message = "goes with a URDF file; this robot is a table, which has no links"
            raise RobotFileError(message, key=key)
    try:
        return robot_from_dict(keys.robot).with_limits(limits)
    except RobotFileError:
        raise
    except ValueError as error:
        raise RobotFileError(str(error), key="limits") from error


def _limits_key(keys: Specification) -> str:
    """The key at which limits are wrong or missing."""
    return "joints.limits_mm" if keys.joints.limits_mm else "joints.limits_deg"
