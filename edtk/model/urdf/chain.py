"""The joints between two links of a URDF file."""

import re
from collections.abc import Sequence

from edtk.model.robot_from_dict import RobotFileError
from edtk.model.urdf.urdf import Urdf, UrdfJoint

MOST_LISTED = 100  # characters of names in a message
MOST_JOINTS = 100  # of a chain; pictures and tables of more are of no use
OF_END_EFFECTORS = re.compile(r"gripper|finger|thumb|knuckle|jaw|claw", re.IGNORECASE)
REFUSED = ("floating", "planar")


def chain(
    tree: Urdf, base: str | None = None, tip: str | None = None, where: str | None = None
) -> list[UrdfJoint]:
    """Find the joints from one link to another, fixed ones included.

    Args:
        tree: The links and joints.
        base: Name of the link that stands in the world; defaults to the only root, or to the root
            above the tip.
        tip: Name of the link that carries the tool; defaults to the only leaf that a joint moves.
        where: The file, for messages.

    Returns:
        The joints from base to tip, of which at least one moves.

    Raises:
        RobotFileError: A link is missing, not below the other or to be chosen; one line says which.
    """
    for key, link in (("base_link", base), ("tip_link", tip)):
        if link is not None and link not in tree.links:
            listed = _listed(list(tree.links))
            message = f"has no link {link!r}; its links are {listed}"
            raise RobotFileError(message, where=where, key=key)
    if tip is None:
        base = _root(tree, where) if base is None else base
        tip = _leaf(tree, base, where)
    path = _path(tree, base, tip, where)
    for joint in path:
        if joint.kind in REFUSED:
            message = f"is {joint.kind}; expected fixed, revolute, continuous or prismatic joints"
            key = f"joint {joint.name}"
            raise RobotFileError(f"{message} between base_link and tip_link", where=where, key=key)
    moving = sum(joint.kind != "fixed" for joint in path)
    if not 0 < moving <= MOST_JOINTS:
        message = f"{moving} joints move it; expected 1 to {MOST_JOINTS} between it and the base"
        raise RobotFileError(message, where=where, key=f"link {tip}")
    return path


def arm_of(tree: Urdf, base: str | None = None) -> tuple[str | None, tuple[str, ...]]:
    """Find where an arm ends and its end effector begins.

    A joint is the end effector's if its name, or that of the link that it moves, says so.

    Args:
        tree: The links and joints.
        base: Name of the base link; defaults to the root.

    Returns:
        The only leaf that the arm's own joints move, and the end effector's joints; None and no
        joints where there is no such leaf, or no such joint.
    """
    own = [
        joint.name
        for joint in tree.joints.values()
        if joint.kind != "fixed" and OF_END_EFFECTORS.search(f"{joint.name} {joint.child}")
    ]
    if not own:
        return None, ()
    try:
        leaves = _leaves(tree, _root(tree, None) if base is None else base, own)
    except RobotFileError:
        return None, ()
    return (leaves[0], tuple(own)) if len(leaves) == 1 else (None, ())


def _root(tree: Urdf, where: str | None) -> str:
    """The only root that moves something."""
    roots = [root for root in tree.roots if tree.below[root]] or tree.roots
    if len(roots) == 1:
        return roots[0]
    if not roots:
        found = "every link is moved by a joint" if tree.links else "has no <link>"
        raise RobotFileError(f"{found}; expected a tree of links", where=where)
    message = f"has {len(roots)} roots; expected one of {_listed(roots)}"
    raise RobotFileError(message, where=where, key="base_link")


def _leaf(tree: Urdf, base: str, where: str | None) -> str:
    """The only leaf below the base that a joint moves."""
    leaves = _leaves(tree, base)
    if len(leaves) == 1:
        return leaves[0]
    if not leaves:
        message = f"no joint moves a link below {base!r}; expected a revolute or prismatic one"
        raise RobotFileError(message, where=where)
    message = f"has {len(leaves)} leaves below {base!r}; expected one of {_listed(leaves)}"
    raise RobotFileError(message, where=where, key="tip_link")


def _leaves(tree: Urdf, base: str, without: Sequence[str] = ()) -> list[str]:
    """The leaves below the base that a joint moves, where some joints are left out."""
    leaves = []
    waiting = [(base, False)]
    seen = {base}
    while waiting:
        link, moved = waiting.pop()
        below = [joint for joint in tree.below[link] if joint.name not in without]
        if moved and not below:
            leaves.append(link)
        for joint in reversed(below):
            if joint.child not in seen:
                seen.add(joint.child)
                waiting.append((joint.child, moved or joint.kind != "fixed"))
    return leaves


def _path(tree: Urdf, base: str | None, tip: str, where: str | None) -> list[UrdfJoint]:
    """The joints from the base, or from the root, down to the tip."""
    path: list[UrdfJoint] = []
    link = tip
    seen = {tip}
    while link != base and link in tree.above:
        joint = tree.above[link]
        path.append(joint)
        link = joint.parent
        if link in seen:
            raise RobotFileError("is in a ring of joints", where=where, key=f"link {link}")
        seen.add(link)
    if base is not None and link != base:
        message = f"has {tip!r}, but not below the base {base!r}; its root is {link!r}"
        raise RobotFileError(message, where=where, key="tip_link")
    return path[::-1]


def _listed(names: list[str]) -> str:
    """The first names, and how many more there are."""
    shown = names[:1]
    for name in names[1:]:
        if len(", ".join([*shown, name])) > MOST_LISTED:
            break
        shown.append(name)
    more = len(names) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more else "")
