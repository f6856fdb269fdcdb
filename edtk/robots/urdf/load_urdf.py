"""A robot from a URDF file: the chain between two of its links."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from edtk.robots.joint import ONE_TURN, Joint, Kind, TiedJoint
from edtk.robots.robot import Robot
from edtk.robots.robot_file import RobotFileError, told_at
from edtk.robots.urdf.chain import Limits, arm_of, bodies, chain, limits_of, motion, resolve_tie
from edtk.robots.urdf.parse_urdf import Mimic, Urdf, UrdfJoint, parse_urdf, urdf_of
from edtk.robots.urdf.xacro import expand_xacro
from edtk.system.errors import UserError
from edtk.system.files import read_text
from edtk.system.typing import Array

XACRO = ".xacro"


class OpenLimitsError(RobotFileError):
    """A robot's file leaves limits open.

    Args:
        message: What is missing, and how to give it.
        where: The file.
        joints: Kinds of these joints, by name.

    Attributes:
        joints: As given.
    """

    def __init__(
        self, message: str, *, where: str | None = None, joints: Mapping[str, Kind] | None = None
    ) -> None:
        super().__init__(message, where=where, key="limits")
        self.joints = dict(joints or {})


def load_urdf(
    path: Path,
    base: str | None = None,
    tip: str | None = None,
    limits: Mapping[str, Limits] | None = None,
    name: str | None = None,
) -> Robot:
    """Read the chain between two links of a URDF file.

    The world's frame is that of the base link; tools are given in the frame of the tip link. Fixed
    joints are merged into the joints before them. A continuous joint has limits of one turn. A
    joint that follows another one of the chain (mimic) is tied to it; of several that follow a
    joint outside the chain, the first one is free.

    Args:
        path: The file; the macros of one that ends in ".xacro" are expanded.
        base: Name of the base link; defaults to the root.
        tip: Name of the tip link; defaults to the leaf, where a joint moves one only.
        limits: Lower and upper limits by joint, which take the place of those of the file
            [rad or m].
        name: How messages name the file; defaults to its path.

    Raises:
        RobotFileError: One line that says which joint or link, and what was expected.
    """
    where = f"robot {name or path}"
    tree, joints = chain_of(path, base, tip, where)
    first = joints[0].parent
    last = joints[-1].child
    moving = _Moving(tree, [joint for joint in joints if joint.kind != "fixed"], where)
    if not moving.joints:
        raise RobotFileError("no joint moves it", where=where, key=f"link {last}")
    origins, flange = _merged(joints)
    free, tied = moving.built(origins, dict(limits or {}))
    return Robot(
        tree.name or path.stem,
        free,
        tool=flange,
        source=" ".join(f"URDF {path.name}, {first} to {last}".split()),
        links=bodies(tree, moving.joints),
        flange=flange,
        tied=tied,
    )


def chain_of(
    path: Path, base: str | None, tip: str | None, where: str
) -> tuple[Urdf, list[UrdfJoint]]:
    """The links and joints of a file, and its joints from one link to another, fixed ones included.

    Joints of the chain that follow one that does not move are fixed.

    Raises:
        RobotFileError: See `load_urdf`.
    """
    tree = _tree(path, where)
    ends = chain(tree, base, tip, where)
    tree = _without_constant_joints(tree, ends, where)
    return tree, [tree.joints[joint.name] for joint in ends]


def arm_in(
    path: Path, base: str | None = None, name: str | None = None
) -> tuple[str | None, tuple[str, ...]]:
    """Find the link at which an arm ends and its end effector begins, see `arm_of`.

    Args:
        path: The file.
        base: Name of the base link; defaults to the root.
        name: How messages name the file; defaults to its path.

    Raises:
        RobotFileError: The file cannot be read.
    """
    return arm_of(_tree(path, f"robot {name or path}"), base)


def _tree(path: Path, where: str) -> Urdf:
    """The links and joints of the file, its macros expanded."""
    if path.name.endswith(XACRO):
        return urdf_of(expand_xacro(path, where), where)
    try:
        text = read_text(path)
    except UserError as error:
        raise RobotFileError(error.message, where=f"robot file {path}", key=error.key) from error
    return parse_urdf(text, where)


def _without_constant_joints(tree: Urdf, joints: Sequence[UrdfJoint], where: str) -> Urdf:
    """The same tree, in which joints of the chain that follow one that does not move are fixed."""
    constant = {}
    for joint in joints:
        tie = resolve_tie(tree, joint.name, where)
        is_tied = joint.mimic is not None and joint.kind != "fixed"
        if is_tied and (tie.factor == 0 or tree.joints[tie.master].kind == "fixed"):
            origin = joint.origin @ motion(joint, tie.offset)
            constant[joint.name] = replace(joint, kind="fixed", origin=origin)
    return replace(tree, joints=tree.joints | constant)


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


@dataclass(frozen=True, eq=False)
class _Moving:
    """The joints of a chain that move.

    Attributes:
        tree: All links and joints.
        joints: The joints of the chain that move, from base to tip.
        where: The file, for messages.
    """

    tree: Urdf
    joints: list[UrdfJoint]
    where: str

    def built(
        self, origins: list[Array], given: dict[str, Limits]
    ) -> tuple[tuple[Joint, ...], tuple[TiedJoint, ...]]:
        """Free and tied joints, with origins (4, 4) relative to the joint before."""
        ties = [resolve_tie(self.tree, joint.name, self.where) for joint in self.joints]
        names = [joint.name for joint in self.joints]
        masters = {tie.master: tie.master for tie in ties if tie.master in names}
        for name, tie in zip(names, ties, strict=True):
            masters.setdefault(tie.master, name)
        own = {masters[tie.master]: ties[names.index(masters[tie.master])] for tie in ties}
        free = [joint for joint in self.joints if joint.name in own]
        limits = self._limits(free, given)
        found = []
        tied = []
        for i, (joint, tie) in enumerate(zip(self.joints, ties, strict=True)):
            master = masters[tie.master]
            with told_at(self.where):
                if joint.name == master:
                    found.append(_joint(joint, origins[i], limits[master], given))
                else:
                    tied.append(_tied(joint, origins[i], i, master, tie, own[master]))
        return tuple(found), tuple(tied)

    def _limits(self, free: list[UrdfJoint], given: dict[str, Limits]) -> dict[str, Limits]:
        """Limits by joint; all that the file leaves open are asked for at once."""
        chain = [joint.name for joint in self.joints]
        found = {
            joint.name: given.get(joint.name) or limits_of(self.tree, joint, chain, self.where)
            for joint in free
        }
        asked = [joint for joint in free if found[joint.name] is None]
        if asked:
            names = ", ".join(joint.name for joint in asked)
            unit = "mm" if asked[0].kind == "prismatic" else "deg"
            message = (
                f"the file has no range for {names}; expected limits from the study, as "
                f"[joints] limits_{unit} = {{ {asked[0].name} = [LOWER, UPPER] }}"
            )
            kinds = {joint.name: _kind(joint) for joint in asked}
            raise OpenLimitsError(message, where=self.where, joints=kinds)
        return {name: limits for name, limits in found.items() if limits is not None}


def _kind(joint: UrdfJoint) -> Kind:
    return "prismatic" if joint.kind == "prismatic" else "revolute"


def _joint(joint: UrdfJoint, origin: Array, limits: Limits, given: dict[str, Limits]) -> Joint:
    """A free joint."""
    endless = joint.kind == "continuous" and joint.name not in given and limits == ONE_TURN
    return Joint(joint.name, origin, joint.axis, limits, _kind(joint), endless)


def _tied(
    joint: UrdfJoint, origin: Array, place: int, master: str, tie: Mimic, own: Mimic
) -> TiedJoint:
    """A joint that follows a free one, whose own tie may be to a joint outside the chain."""
    factor = tie.factor / own.factor
    offset = tie.offset - factor * own.offset
    follows = ((master, factor),)
    return TiedJoint(joint.name, origin, joint.axis, _kind(joint), place, follows, offset)
