"""`edtk check`: whether a plan is free of what stands in the cell, and what is seen of it."""

from pathlib import Path

import click

from edtk.commands.shared import PARTIAL, FilePath, json_option, show


@click.command("check", short_help="Say whether a plan touches anything, and what is seen.")
@click.argument("study", type=FilePath)
@click.argument("plan", type=FilePath)
@json_option
def command(study: Path, plan: Path, as_json: bool) -> int:
    """Look at each pose of PLAN (CSV) in the cell of STUDY (TOML, with [scene]), and at the ways.

    Where STUDY has a [sight], beside a [scene] or alone, the markers that are hidden in each pose
    are named, with reasons.
    The clearance is the least distance of two bodies, less the margin. The ways lead from pose to
    pose in the order of the plan's sheet, all joints in step, by via poses where that is not free.
    The exit code is 1 where something touches, or where no free way is found.
    """
    from edtk.verbs.evaluate import check

    found = check(study, plan)
    show(found, as_json)
    return 0 if found.free else PARTIAL
