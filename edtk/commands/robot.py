"""`edtk robot`: a robot before a study is made of it."""

from pathlib import Path

import click

from edtk.commands.shared import FilePath, json_option, show


@click.command("robot", short_help="Show a robot: joints, reach, what loads them.")
@click.argument("robot", metavar="ROBOT")
@click.option("--base", help="Link of a URDF that stands in the world [default: its root].")
@click.option("--tip", help="Link of a URDF with the tool [default: its only leaf but grippers].")
@click.option("--plot", type=FilePath, help="Picture to write (.png, .svg or .pdf).")
@json_option
def command(
    robot: str, base: str | None, tip: str | None, plot: Path | None, as_json: bool
) -> None:
    """Show ROBOT, a built-in one or a robot's file (TOML or URDF).

    Lists joints with limits, reach and mass, and which joints a vertical load turns: the others
    need a load of another direction.
    """
    from edtk.verbs.robot import robot as look_at

    show(look_at(robot, base=base, tip=tip, plot=plot), as_json)
