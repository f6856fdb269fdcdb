"""`edtk.robot`: a robot, what it can do, and what loads its joints."""

from pathlib import Path

from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.robots.robot_overview import Parts, RobotOverview
from edtk.robots.urdf.load_urdf import OpenLimitsError
from edtk.system.arguments import checked
from edtk.system.errors import UserError
from edtk.verbs.inputs import links_by_flags, require_output

STAND_IN = {"revolute": (-3.141592653589793, 3.141592653589793), "prismatic": (-1.0, 1.0)}


@checked
def robot(
    name: Path | str,
    *,
    base: str | None = None,
    tip: str | None = None,
    plot: Path | str | None = None,
) -> RobotOverview:
    """Read a robot and look at it before a study is made of it.

    Args:
        name: Name of a built-in robot, or the path of a robot's file (TOML or URDF).
        base: Link of a URDF that stands in the world; defaults to its root.
        tip: Link of a URDF that carries the tool; defaults to its leaf, where it has one only.
        plot: Picture to write (PNG, SVG or PDF, by its ending).

    Returns:
        Joints, reach, loads and bodies. Joints whose limits a file leaves open are in `open`.

    Raises:
        UserError: The robot or the picture's name is not valid.
        OSError: The picture cannot be written.
    """
    from edtk.report.figures import picture_file, require_picture

    if plot is not None:
        require_picture(plot)
        require_output(plot, name)
    try:
        with links_by_flags():
            arm = load_robot(name, base=base, tip=tip)
        found = RobotOverview(arm, parts=_parts(arm, name, base, tip))
    except OpenLimitsError as error:
        limits = {joint: STAND_IN[kind] for joint, kind in error.joints.items()}
        arm = load_robot(name, base=base, tip=tip, limits=limits)
        found = RobotOverview(arm, tuple(limits), _parts(arm, name, base, tip))
    if plot is not None:
        picture_file(found, plot)
    return found


def _parts(arm: Robot, name: Path | str, base: str | None, tip: str | None) -> Parts:
    """The robot's bodies; where they cannot be read, why. A study without a cell needs none."""
    from edtk.cell.pairs import parts_of
    from edtk.cell.robot_bodies import robot_bodies

    try:
        bodies = robot_bodies(arm, str(name), base=base, tip=tip)
    except UserError as error:
        return Parts(unknown=str(error))
    if not bodies:
        return Parts(unknown="the file has no [[body]] and no shapes")
    return parts_of(arm, bodies)
