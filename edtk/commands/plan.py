"""`edtk plan`: the best plan of exactly m experiments."""

import json
import sys
from pathlib import Path

import click
from tqdm import tqdm

from edtk.commands.shared import (
    FilePath,
    Range,
    dask_option,
    mistakes_in,
    require_output,
    team_of,
    workers_option,
)


@click.command("plan")
@click.argument("study", type=FilePath)
@click.option(
    "--size",
    type=click.IntRange(min=1),
    required=True,
    help="Number of experiments m, kept ones counted.",
)
@click.option(
    "--distinct",
    type=click.IntRange(min=1),
    help="Distinct new poses at most [default: p(p+1)/2 + 1 of p parameters].",
)
@click.option(
    "--criterion",
    "name",
    help="Criterion to optimise [default: rho0 where the study optimises it, else its first "
    "criterion].",
)
@click.option("--keep", type=FilePath, help="Plan (CSV) of experiments that are there already.")
@click.option("--exclude", type=FilePath, help="Plan (CSV) of poses to stay away from.")
@click.option("--budget", type=Range(min=0, min_open=True), help="Seconds after which to stop.")
@workers_option
@dask_option
@click.option("--seed", type=click.IntRange(min=0), help="Seed [default: the study's].")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option("--out", type=FilePath, help="Write all experiments (CSV).")
def command(
    study: Path,
    size: int,
    distinct: int | None,
    name: str | None,
    keep: Path | None,
    exclude: Path | None,
    budget: float | None,
    workers: int | None,
    dask: str | None,
    seed: int | None,
    as_json: bool,
    out: Path | None,
) -> None:
    """The best plan of exactly m experiments for STUDY (TOML), and how far it is from the bound.

    Ctrl-C, or the end of the budget, leaves the best plan so far.
    """
    from edtk.study.plan_study import plan_study
    from edtk.study.run_options import RunOptions
    from edtk.study.study import load_study

    loaded = load_study(study, exclude)
    kept = loaded.load_plan(keep) if keep is not None else None
    require_output(out, *loaded.reads, keep)
    with (
        team_of(workers, dask) as pool,
        tqdm(unit="step", file=sys.stderr, bar_format="{desc} [{elapsed}]", desc="bound") as bar,
        mistakes_in(study),
    ):
        options = RunOptions(
            seed=seed,
            workers=pool,
            progress=lambda label, number: bar.set_description_str(label),
        )
        found = plan_study(
            loaded, size, name, distinct=distinct, kept=kept, budget=budget, options=options
        )
    if out is not None:
        found.whole.to_csv(out, loaded.robot)
    click.echo(json.dumps(found.to_dict(), indent=2) if as_json else found.summary())
    if found.ended in ("budget", "interrupted"):
        why = "the budget ended the search" if found.ended == "budget" else "interrupted"
        click.echo(f"edtk: {why}; this is the best plan so far", err=True)
    if found.ended == "interrupted":
        sys.exit(130)
