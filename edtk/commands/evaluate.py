"""`edtk evaluate`: a plan under all criteria."""

from pathlib import Path

import click

from edtk.commands.shared import FilePath, json_option, show, warn, warn_about


@click.command("evaluate", short_help="Score a plan under every criterion.")
@click.argument("study", type=FilePath)
@click.argument("plan", type=FilePath)
@json_option
def command(study: Path, plan: Path, as_json: bool) -> None:
    """Score PLAN (CSV) under every criterion of STUDY (TOML)."""
    from edtk.verbs.evaluate import evaluate

    found = evaluate(study, plan)
    show(found, as_json)
    for problem in found.skipped.values():
        warn(f"left out: {problem}")
    warn_about(study, found.warnings)
