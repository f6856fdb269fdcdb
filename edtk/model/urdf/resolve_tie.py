"""Which joint a joint of a URDF file follows in the end."""

from edtk.model.robot_from_dict import RobotFileError
from edtk.model.urdf.urdf import Mimic, Urdf

LEAST = 1e-6  # factor of a tie; a smaller one, or one beyond its reciprocal, is a slip of the pen
MOST_TIES = 100  # from a joint to the one that it follows in the end
UNKNOWN = ("floating", "planar")  # joints without one variable that could be followed


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
