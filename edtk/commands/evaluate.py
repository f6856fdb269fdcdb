"""`edtk evaluate`: a plan under all criteria."""

import json
from pathlib import Path

import click

from edtk.commands.shared import FilePath, mistakes_in


@click.command("evaluate")
@click.argument("study", type=FilePath)
@click.argument("plan", type=FilePath)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, in SI units.")
def command(study: Path, plan: Path, as_json: bool) -> None:
    """Score PLAN (CSV) under every criterion of STUDY (TOML)."""
    from edtk.study.evaluate import evaluate
    from edtk.study.study import load_study

    loaded = load_study(study)
    with mistakes_in(plan):
        result = evaluate(loaded, loaded.load_plan(plan))
    click.echo(json.dumps(result.to_dict(), indent=2) if as_json else result.summary())
