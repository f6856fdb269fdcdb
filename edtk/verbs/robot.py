"""A robot before a study is made of it: `edtk.robot`, and how it counts: `edtk.controller`."""

from dataclasses import replace
from pathlib import Path

from edtk.findings.gross_errors import GrossErrors, gross_findings
from edtk.findings.sound_rows import rigid_tool
from edtk.fit.controller.find_controller import FoundController, find_controller
from edtk.fit.controller.fits import Positions
from edtk.fit.marker_positions import MarkerPositions, read_positions
from edtk.measure.pose_table import Table
from edtk.robots.load_robot import end_of_arm, load_robot
from edtk.robots.robot import Robot
from edtk.robots.robot_overview import Parts, RobotOverview
from edtk.robots.urdf.load_urdf import OpenLimitsError
from edtk.study.study_toml import toml_text
from edtk.system.arguments import checked
from edtk.system.errors import UserError
from edtk.system.files import write_text
from edtk.verbs.inputs import as_table, errors_in, links_by_flags, name_of, require_output

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
        tip: Link of a URDF that carries the tool; defaults to its leaf, where it has one only. The
            joints of a gripper are left out.
        plot: Picture to write (PNG, SVG or PDF, by its ending).

    Returns:
        Joints, reach, loads and bodies. Joints whose limits a file leaves open are in `open`, those
        of a gripper in `left_out`.

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
            tip, left_out = (tip, ()) if tip is not None else end_of_arm(str(name), base)
            arm = load_robot(name, base=base, tip=tip)
        found = RobotOverview(arm, (), _parts(arm, name, base, tip), left_out)
    except OpenLimitsError as error:
        limits = {joint: STAND_IN[kind] for joint, kind in error.joints.items()}
        arm = load_robot(name, base=base, tip=tip, limits=limits)
        found = RobotOverview(arm, tuple(limits), _parts(arm, name, base, tip), left_out)
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


@checked
def controller(
    robot: Robot | Path | str,
    positions: MarkerPositions | Table,
    *,
    base: str | None = None,
    tip: str | None = None,
    out: Path | str | None = None,
) -> FoundController:
    """Find sign, zero and coupling of the joints from a handful of measured positions.

    Neither the place of the instrument nor that of the markers need be known.

    Args:
        robot: A robot, the name of a built-in one, or the path of a robot's file (TOML or URDF).
        positions: Measured positions, a data frame, or the path of a CSV file, as `identify` reads
            them: joint values as the controller shows them, and `x_mm y_mm z_mm` with `marker` if
            there are several, or `NAMEx_mm NAMEy_mm NAMEz_mm` for each marker.
        base: Link of a URDF that stands in the world; defaults to its root.
        tip: Link of a URDF that carries the tool; defaults to its leaf, where it has one only.
        out: File to write the table `controller` to (TOML), "-" for standard output.

    Returns:
        The table `controller` of the best way to count, and how sure it is.

    Raises:
        UserError: A file is not valid, or there are too few positions.
    """
    if out is not None:
        with errors_in(out):
            read = (given for given in (robot, positions) if isinstance(given, str | Path))
            require_output(out, *read)
    with links_by_flags():
        arm = robot if isinstance(robot, Robot) else load_robot(str(robot), base=base, tip=tip)
    sheet = positions
    if not isinstance(sheet, MarkerPositions):
        as_shown = replace(arm, controller=None)  # the file's values are the controller's own
        sheet = read_positions(as_table(sheet, "positions"), as_shown, {}, {})
    if len(sheet) and not len(sheet.absolute):
        message = "has displacements alone; expected positions, x_mm y_mm z_mm"
        raise UserError(message, where=name_of(positions, "positions"))
    sheet = sheet.absolute.without_lost()
    if not sheet.count:
        message = "no position of a marker is filled in, or all are zero"
        raise UserError(message, where=name_of(positions, "positions"))
    tool = rigid_tool(sheet)
    said = gross_findings(sheet, GrossErrors(tool.swapped, (), tool.apart))
    sound = tool.without_swapped(tool.without_apart(sheet))
    try:
        found = find_controller(arm, Positions.of_sheet(sound))
    except UserError as error:
        raise UserError(error.message, where=name_of(positions, "positions")) from error
    if out is not None:
        with errors_in(out):
            write_text(out, toml_text({"controller": found.best.table()}))
    return replace(found, left_out=tuple(one.words for one in said))
