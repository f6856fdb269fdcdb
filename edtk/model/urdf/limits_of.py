"""The limits of a joint of a URDF file, and of all joints that follow it."""

import math
from collections.abc import Collection

from edtk.model.joint import ONE_TURN
from edtk.model.robot_from_dict import RobotFileError
from edtk.model.urdf.resolve_tie import resolve_tie
from edtk.model.urdf.urdf import Mimic, Urdf, UrdfJoint

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
