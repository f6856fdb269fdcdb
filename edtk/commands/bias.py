"""`edtk bias`: what identifying with the linear model costs."""

import json
from pathlib import Path

import click

from edtk.commands.shared import FilePath, mistakes_in


@click.command("bias")
@click.argument("study", type=FilePath)
@click.argument("plan", type=FilePath)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, in SI units.")
def command(study: Path, plan: Path, as_json: bool) -> None:
    """How wrong the linear model makes the compliances that PLAN (CSV) identifies.

    The robot of the [simulation] of STUDY (TOML) comes to rest under each load of the plan, however large; the linear
    model, Eq. (2), is fitted to its deflections.
    """
    from edtk.calibration.plan_bias import plan_bias
    from edtk.study.study import load_study

    loaded = load_study(study)
    with mistakes_in(plan):
        found = plan_bias(loaded, loaded.load_plan(plan), plan)
    click.echo(json.dumps(found.to_dict(), indent=2) if as_json else found.summary())
