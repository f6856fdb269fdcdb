"""`edtk evaluate`: a plan under all criteria."""

import json
from pathlib import Path

import click

import criteria
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
    if as_json:
        click.echo(json.dumps(result.to_dict(), indent=2))
        return
    click.echo(f"{result.experiments} experiments")
    for name, value in result.criteria.items():
        cls = criteria.get(name)
        factor, unit = cls.shown
        shown = f"{factor * value:.6g} {unit}"
        click.echo(f"  {name:6}{cls.sense:5}{shown:18}{cls.formula}")
    click.echo("standard deviations")
    for name, std, unit in zip(result.parameters, result.std, loaded.model.units, strict=True):
        click.echo(f"  {name:6}{std:.4g} {unit}")
