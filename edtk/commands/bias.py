"""`edtk bias`: what identifying with the linear model costs."""

import json
from pathlib import Path

import click

from edtk.errors import UserError

FilePath = click.Path(path_type=Path, dir_okay=False)


@click.command("bias")
@click.argument("study", type=FilePath)
@click.argument("plan", type=FilePath)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, in SI units.")
def command(study: Path, plan: Path, as_json: bool) -> None:
    """How wrong the linear model makes the compliances that PLAN (CSV) identifies.

    The robot of the [simulation] of STUDY (TOML) comes to rest under each load of the plan, however large; the linear
    model, Eq. (2), is fitted to its deflections.
    """
    from edtk.inference import SingularPlanError
    from edtk.study import load_study
    from edtk.study.biased import biased

    loaded = load_study(study)
    try:
        found = biased(loaded, loaded.load_plan(plan), plan)
    except SingularPlanError as error:
        raise UserError(f"{plan}: {error}") from error
    click.echo(json.dumps(found.to_json(), indent=2) if as_json else found.summary())
