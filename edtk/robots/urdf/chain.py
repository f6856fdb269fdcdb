"""The joints between two links of a URDF file: their motion, ties, limits, and what they carry."""

import math
import re
from collections.abc import Collection, Iterator, Sequence

import numpy as np

from edtk.robots.joint import ONE_TURN, Link
from edtk.robots.robot_file import RobotFileError
from edtk.robots.rotations import transform
from edtk.robots.urdf.parse_urdf import Mimic, Urdf, UrdfJoint
from edtk.system.typing import Array

LEAST = 1e-6  # factor of a tie; a smaller one, or one beyond its reciprocal, is a slip of the pen
MOST_TIES = 100  # from a joint to the one that it follows in the end
UNKNOWN = ("floating", "planar")  # joints without one variable that could be followed
MOST_LISTED = 100  # characters of names in a message
MOST_JOINTS = 100  # of a chain; pictures and tables of more are of no use
REFUSED = ("floating", "planar")


def motion(joint: UrdfJoint, q: float) -> Array:
    """Transform (4, 4) from a joint's frame at zero to that at q [m].

    Args:
        joint: A joint; one that is neither prismatic nor turns does not move.
        q: Its variable [rad or m].
    """
    if not q or joint.kind not in ("revolute", "continuous", "prismatic"):
        return np.eye(4)
    axis = joint.axis / np.linalg.norm(joint.axis)
    if joint.kind == "prismatic":
        return transform(q * axis)
    from scipy.spatial.transform import Rotation

    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(q * axis).as_matrix()
    return T


def resolve_tie(tree: Urdf, name: str, where: str | None = None) -> Mimic:
    """Follow the ties of a joint to one that is tied to none.

    Args:
        tree: The links and joints.
        name: Name of the joint.
        where: The file, for messages.

    Returns:
        The joint at the end, and the tie to it; of a joint that follows none, itself.

    Raises:
        RobotFileError: A tie leads to no joint, in a circle, or to a joint without one variable, or
            its factor is absurd.
    """
    factor = 1.0
    offset = 0.0
    joint = tree.joints[name]
    seen = {name}
    while joint.mimic is not None:
        offset += factor * joint.mimic.offset
        factor *= joint.mimic.factor
        master = joint.mimic.master
        if master not in tree.joints or tree.joints[master].kind in UNKNOWN:
            has = "which is no joint" if master not in tree.joints else "which has no single value"
            message = f"follows {master!r} (mimic), {has}"
            raise RobotFileError(message, where=where, key=f"joint {joint.name}")
        if master in seen:
            message = f"follows {master!r} (mimic), which follows it; expected no circle"
            raise RobotFileError(message, where=where, key=f"joint {joint.name}")
        seen.add(master)
        if len(seen) > MOST_TIES:
            message = f"follows another joint by way of more than {MOST_TIES} others (mimic)"
            raise RobotFileError(message, where=where, key=f"joint {name}")
        joint = tree.joints[master]
    if factor and not LEAST <= abs(factor) <= 1 / LEAST:
        message = f"moves by {factor:g} for one unit of {joint.name!r}, which it follows (mimic)"
        raise RobotFileError(message, where=where, key=f"joint {name}")
    return Mimic(joint.name, factor, offset)


Limits = tuple[float, float]


def limits_of(
    tree: Urdf, joint: UrdfJoint, chain: Collection[str], where: str | None = None
) -> Limits | None:
    """Find how far a joint can move, with the joints of its chain that move with it.

    Joints that follow one another move as far as each of them can, the one that all of them follow
    included. Limits that the file leaves open, or that are equal, bound nothing; one turn is
    `ONE_TURN`, of a joint that turns without end. Joints beside the chain do not count: files are
    careless about limits of fingers that follow others.

    Args:
        tree: The links and joints.
        joint: The joint, whose own limits are known.
        chain: Names of the joints of the chain.
        where: The file, for messages.

    Returns:
        Lower and upper limit [rad or m]; None where the file leaves them open.

    Raises:
        RobotFileError: Limits are swapped, or leave no range.
    """
    own = _range(joint, where)
    others = _moving_with(tree, joint, chain, where)
    if joint.kind == "continuous":
        if all(_turns_on(other, tie) for other, tie in others):
            return ONE_TURN
        own = (-math.inf, math.inf)
    if own is None:
        return None
    lower, upper = own
    for other, tie in others:
        # Other joints' values are tie.factor * q + tie.offset.
        ends = [(end - tie.offset) / tie.factor for end in _range(other, where) or ()]
        if ends:
            lower = max(lower, min(ends))
            upper = min(upper, max(ends))
    if not lower < upper:
        names = ", ".join(other.name for other, _ in others)
        unit = "mm" if joint.kind == "prismatic" else "deg"
        message = (
            f"the limits of {joint.name} and of {names}, which moves with it, leave no range; "
            f"expected [joints] limits_{unit} in the study"
        )
        raise RobotFileError(message, where=where, key="limits")
    return (lower, upper) if math.isfinite(upper - lower) else None


def _range(joint: UrdfJoint, where: str | None) -> Limits | None:
    """The limits of a joint itself; None where the file leaves them open."""
    lower, upper = joint.limits
    if lower is None or upper is None or lower == upper:
        return None
    if lower > upper:
        message = f"the lower limit {lower:g} lies above the upper one {upper:g}; are they swapped?"
        raise RobotFileError(message, where=where, key=f"joint {joint.name}")
    return lower, upper


def _moving_with(
    tree: Urdf, joint: UrdfJoint, chain: Collection[str], where: str | None
) -> list[tuple[UrdfJoint, Mimic]]:
    """The other joints that move with a joint, and what they do for its variable."""
    own = resolve_tie(tree, joint.name, where)
    found = []
    for name in dict.fromkeys((own.master, *chain)):
        tie = resolve_tie(tree, name, where)
        if name != joint.name and tie.master == own.master:
            factor = tie.factor / own.factor
            mimic = Mimic(joint.name, factor, tie.offset - factor * own.offset)
            found.append((tree.joints[name], mimic))
    return found


def _turns_on(joint: UrdfJoint, tie: Mimic) -> bool:
    """Whether a joint is where it was after its master has turned once."""
    return joint.kind == "continuous" and tie.factor == round(tie.factor)


def bodies(tree: Urdf, moving: Sequence[UrdfJoint]) -> tuple[Link, ...]:
    """Lump the links that each joint of a chain moves into one body, up to the next joint.

    Links behind fixed joints belong to the body. So do branches beside the chain, whose joints
    stand at zero, or at the limit that is nearest to it: their weight is carried all the same. A
    link without inertia has no mass, as URDF has it.

    Args:
        tree: The links and joints.
        moving: The joints of the chain that move, from base to tip.

    Returns:
        Mass and centre of each body in the frame of its joint; empty if all masses are zero.
    """
    carriers = {joint.name for joint in moving}
    found = tuple(_body(tree, joint, carriers) for joint in moving)
    return found if any(link.mass for link in found) else ()


def _body(tree: Urdf, carrier: UrdfJoint, carriers: set[str]) -> Link:
    mass = 0.0
    moment = np.zeros(3)
    for name, T in links_below(tree, carrier.child, carriers):
        link = tree.links[name]
        if link is not None:
            mass += link.mass
            moment += link.mass * (T[:3, :3] @ link.center + T[:3, 3])
    return Link(mass, moment / mass if mass else moment)


def links_below(
    tree: Urdf, first: str, carriers: Collection[str], T: Array | None = None
) -> Iterator[tuple[str, Array]]:
    """A link and all below it that move with it, and their frames (4, 4) in that of the first [m].

    Args:
        tree: The links and joints.
        first: Name of the link.
        carriers: Joints that move; others stand at zero, or at the limit that is nearest to it.
        T: Frame of the link itself; defaults to the identity.
    """
    waiting = [(first, np.eye(4) if T is None else T)]
    seen = {first}
    while waiting:
        name, place = waiting.pop()
        yield name, place
        for joint in tree.below[name]:
            if joint.name not in carriers and joint.child not in seen:
                seen.add(joint.child)
                waiting.append((joint.child, place @ joint.origin @ _at_rest(joint)))


def links_at_rest(tree: Urdf, base: str, carriers: Collection[str]) -> Iterator[tuple[str, Array]]:
    """All links that no joint of a chain moves, and their frames (4, 4) in that of its base [m].

    They are those below the base, and those above it with all that these carry.
    """
    yield from links_below(tree, base, carriers)
    T = np.eye(4)
    below = base
    passed: set[str] = set()
    while below in tree.above and tree.above[below].name not in passed:
        joint = tree.above[below]
        passed.add(joint.name)
        T = T @ np.linalg.inv(joint.origin @ _at_rest(joint))
        yield from links_below(tree, joint.parent, {*carriers, joint.name}, T)
        below = joint.parent


def _at_rest(joint: UrdfJoint) -> Array:
    """Motion (4, 4) of a joint beside the chain [m]."""
    lower, upper = joint.limits
    q = 0.0 if lower is None else max(0.0, lower)
    return motion(joint, q if upper is None else min(q, upper))


OF_END_EFFECTORS = re.compile(r"gripper|finger|thumb|knuckle|jaw|claw", re.IGNORECASE)


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
