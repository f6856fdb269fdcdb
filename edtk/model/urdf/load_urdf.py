"""A robot from a URDF file: the chain between two of its links."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from edtk.model.joint import ONE_TURN, Joint, Kind
from edtk.model.robot import Robot
from edtk.model.robot_from_dict import RobotFileError
from edtk.model.urdf.bodies import bodies
from edtk.model.urdf.chain import chain
from edtk.model.urdf.parse_urdf import parse_urdf
from edtk.model.urdf.urdf import UrdfJoint
from edtk.system.errors import UserError
from edtk.system.read_text import read_text
from edtk.system.typing import Array

Limits = tuple[float, float]


def load_urdf(
    path: Path,
    base: str | None = None,
    tip: str | None = None,
    limits: Mapping[str, Limits] | None = None,
    name: str | None = None,
) -> Robot:
    """Read the chain between two links of a URDF file.

    The world's frame is that of the base link; tools are given in the frame of the tip link. Fixed
    joints are merged into the joints before them. A continuous joint has limits of one turn.

    Args:
        path: The file.
        base: Name of the base link; defaults to the root.
        tip: Name of the tip link; defaults to the leaf, where a joint moves one only.
        limits: Lower and upper limits by joint, which take the place of those of the file
            [rad or m].
        name: How messages name the file; defaults to its path.

    Raises:
        RobotFileError: One line that says which joint or link, and what was expected.
    """
    where = f"robot {name or path}"
    try:
        text = read_text(path)
    except UserError as error:
        raise RobotFileError(error.message, where=f"robot file {path}", key=error.key) from error
    tree = parse_urdf(text, where)
    path_joints = chain(tree, base, tip, where)
    moving = [joint for joint in path_joints if joint.kind != "fixed"]
    given = dict(limits or {})
    _require_limits(moving, given, where)
    origins, flange = _merged(path_joints)
    joints = tuple(
        _joint(joint, origin, given.get(joint.name), where)
        for joint, origin in zip(moving, origins, strict=True)
    )
    ends = f"{path_joints[0].parent} to {path_joints[-1].child}"
    return Robot(
        tree.name or path.stem,
        joints,
        tool=flange,
        source=" ".join(f"URDF {path.name}, {ends}".split()),
        links=bodies(tree, moving),
        flange=flange,
    )


def _merged(joints: Sequence[UrdfJoint]) -> tuple[list[Array], Array]:
    """Origins (4, 4) of the joints that move, relative to the one before, and of the tip."""
    origins = []
    before = np.eye(4)
    for joint in joints:
        before = before @ joint.origin
        if joint.kind != "fixed":
            origins.append(before)
            before = np.eye(4)
    return origins, before


def _require_limits(moving: Sequence[UrdfJoint], given: Mapping[str, Limits], where: str) -> None:
    """Ask for all limits that the file leaves open, at once."""
    asked = [joint for joint in moving if joint.name not in given and not _has_limits(joint)]
    if not asked:
        return
    names = ", ".join(joint.name for joint in asked)
    unit = "mm" if asked[0].kind == "prismatic" else "deg"
    message = (
        f"the file has no range for {names}; expected limits from the study, as "
        f"[joints] limits_{unit} = {{ {asked[0].name} = [LOWER, UPPER] }}"
    )
    raise RobotFileError(message, where=where, key="limits")


def _has_limits(joint: UrdfJoint) -> bool:
    """Whether the file limits a joint, or says that it has no limits."""
    lower, upper = joint.limits
    return joint.kind == "continuous" or (None not in (lower, upper) and lower != upper)


def _joint(joint: UrdfJoint, origin: Array, given: Limits | None, where: str) -> Joint:
    """The joint of the robot, with the limits that were given for it or else its own."""
    continuous = joint.kind == "continuous" and given is None
    lower, upper = given or (ONE_TURN if continuous else joint.limits)
    kind: Kind = "prismatic" if joint.kind == "prismatic" else "revolute"
    assert lower is not None
    assert upper is not None
    if not lower < upper:
        message = f"the lower limit {lower:g} lies above the upper one {upper:g}; are they swapped?"
        raise RobotFileError(message, where=where, key=f"joint {joint.name}")
    try:
        return Joint(joint.name, origin, joint.axis, (lower, upper), kind, continuous)
    except ValueError as error:
        raise RobotFileError(str(error), where=where) from error
