"""`edtk bias`: the cost of identifying with the linear model."""

from pathlib import Path

import click

from edtk.commands.shared import FilePath, json_option, show


@click.command("bias", short_help="Tell what the linear model costs.")
@click.argument("study", type=FilePath)
@click.argument("plan", type=FilePath)
@json_option
def command(study: Path, plan: Path, as_json: bool) -> None:
    """Tell how wrong the linear model makes the compliances that PLAN (CSV) identifies.

    The robot of the [simulation] of STUDY (TOML) comes to rest under each load of the plan, however
    large; the linear model is fitted to its deflections.
    """
    from edtk.verbs.evaluate import bias

    show(bias(study, plan), as_json)
