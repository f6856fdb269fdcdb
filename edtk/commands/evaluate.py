"""`edtk evaluate`: a plan under all criteria."""

from pathlib import Path

import click

from edtk.commands.shared import FilePath, json_option, show


@click.command("evaluate", short_help="Score a plan under every criterion.")
@click.argument("study", type=FilePath)
@click.argument("plan", type=FilePath)
@json_option
def command(study: Path, plan: Path, as_json: bool) -> None:
    """Score PLAN (CSV) under every criterion of STUDY (TOML)."""
    from edtk.verbs.evaluate import evaluate

    show(evaluate(study, plan), as_json)
