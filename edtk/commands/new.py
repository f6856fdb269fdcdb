"""`edtk new`: a study to begin with."""

from pathlib import Path

import click

from edtk.commands.shared import FilePath, Range, print_out, warn_about


@click.command("new", short_help="Write a first study of a robot.")
@click.option("--robot", required=True, help="Built-in robot, or a robot's file (TOML or URDF).")
@click.option("--out", type=FilePath, required=True, help="Study to write (TOML).")
@click.option("--base", help="Link of a URDF that stands in the world [default: its root].")
@click.option(
    "--tip",
    help="Link of a URDF with the tool [default: its only leaf but grippers].",
)
@click.option(
    "--limit",
    "limits",
    type=(str, float, float),
    multiple=True,
    metavar="JOINT LOWER UPPER",
    help="Limits of a joint that its file leaves open [deg, mm]; once for each joint.",
)
@click.option(
    "--controller",
    type=FilePath,
    help="Table [controller] (TOML), as edtk controller --out writes it.",
)
@click.option(
    "--payload",
    type=Range(min=0, min_open=True),
    metavar="KG",
    help="Mass that the robot may carry, whose weight is the load [default: a careful guess].",
)
@click.option("--force", is_flag=True, help="Replace a file that exists.")
def command(
    robot: str,
    out: Path,
    base: str | None,
    tip: str | None,
    limits: tuple[tuple[str, float, float], ...],
    controller: Path | None,
    payload: float | None,
    force: bool,
) -> None:
    """Write a commented study of a robot, which runs as it is.

    Tool, load, space and test pose suit the robot's size. "DECIDE:" marks what only you know.
    """
    from edtk.verbs.new import new

    given = {joint: (lower, upper) for joint, lower, upper in limits}
    study = new(
        robot,
        out,
        base=base,
        tip=tip,
        limits=given,
        controller=controller,
        payload=payload,
        force=force,
    )
    lines = out.read_text(encoding="utf-8").splitlines()
    marked = [str(i) for i, line in enumerate(lines, 1) if "DECIDE: " in line]
    print_out(f"{study.summary()}\n\n{out}: decide lines {', '.join(marked)}")
    warn_about(out, study.warnings)
