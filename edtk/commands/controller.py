"""`edtk controller`: how a robot's controller counts the joints."""

from pathlib import Path

import click

from edtk.commands.shared import FilePath, json_option, show, warn


@click.command("controller", short_help="Find signs and zeros of the controller's joints.")
@click.argument("robot")
@click.argument("positions", type=FilePath)
@click.option("--base", help="Link of a URDF that stands in the world [default: its root].")
@click.option("--tip", help="Link of a URDF that carries the tool [default: its only leaf].")
@click.option("--out", type=FilePath, help="Write the table (TOML), for edtk new --controller.")
@json_option
def command(
    robot: str,
    positions: Path,
    base: str | None,
    tip: str | None,
    out: Path | None,
    as_json: bool,
) -> None:
    """Find how the controller of ROBOT counts the joints, from measured POSITIONS (CSV).

    ROBOT is a built-in name or a file (TOML or URDF). The CSV is a sheet of positions as edtk
    identify reads it: joint values as the controller shows them (q1_deg ...), and in the tracker's
    frame either x_mm, y_mm and z_mm, with a column marker if there are several, or NAMEx_mm,
    NAMEy_mm and NAMEz_mm for each marker of a pose. Prints a table [controller] for the study, and
    how sure it is.
    """
    from edtk.verbs.robot import controller

    found = controller(robot, positions, base=base, tip=tip, out=out)
    show(found, as_json, out)
    for sentence in found.left_out:
        warn(f"{positions}: {sentence}")
    if found.far_off:
        warn(
            f"{positions}: the best way to count leaves {1e3 * found.best.rms:.3g} mm; is it this "
            "robot, are positions in millimetres, and angles in degrees?"
        )
    elif not found.clear:
        warn(
            f"{positions}: another way to count fits nearly as well; measure more poses, in which "
            "all joints move"
        )
