"""`edtk.controller`: how a robot's controller counts the joints."""

from dataclasses import replace
from pathlib import Path

from edtk.fit.controller.find_controller import FoundController, find_controller
from edtk.fit.controller.fits import Positions
from edtk.fit.geometry.marker_positions import MarkerPositions, read_positions
from edtk.measure.pose_table import Table
from edtk.robots.load_robot import load_robot
from edtk.robots.robot import Robot
from edtk.study.study_toml import toml_text
from edtk.system.arguments import checked
from edtk.system.errors import UserError
from edtk.system.files import write_text
from edtk.verbs.inputs import as_table, errors_in, links_by_flags, name_of, require_output


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
    try:
        found = find_controller(arm, Positions.of_sheet(sheet))
    except UserError as error:
        raise UserError(error.message, where=name_of(positions, "positions")) from error
    if out is not None:
        with errors_in(out):
            write_text(out, toml_text({"controller": found.best.table()}))
    return found
