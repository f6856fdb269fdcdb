"""`edtk relax`: the best weights, with a bound."""

import json
import sys
from pathlib import Path

import click
from tqdm import tqdm

from edtk.commands.shared import FilePath, Range, mistakes_in, require_output


@click.command("relax")
@click.argument("study", type=FilePath)
@click.option(
    "--criterion",
    "name",
    help="Criterion to optimise [default: rho0 where the study optimises it, else its first "
    "criterion].",
)
@click.option(
    "--candidates", type=click.IntRange(min=1), help="Candidate poses [default: the study's]."
)
@click.option(
    "--continuous", is_flag=True, help="Leave the candidates: search over all feasible poses."
)
@click.option("--seed", type=click.IntRange(min=0), help="Seed [default: the study's].")
@click.option(
    "--memory", type=Range(min=0), default=1000, show_default=True, help="Limit on memory [MB]."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option("--out", type=FilePath, help="Write poses and weights (CSV).")
def command(
    study: Path,
    name: str | None,
    candidates: int | None,
    continuous: bool,
    seed: int | None,
    memory: float,
    as_json: bool,
    out: Path | None,
) -> None:
    """The best weights over candidate poses of STUDY (TOML), with a bound on every design.

    Ctrl-C ends a long run with the best certified plan so far.
    """
    from edtk.design.relaxation.relax_poses import PlanInterrupted
    from edtk.study.relax_study import relax_study
    from edtk.study.run_options import RunOptions
    from edtk.study.study import load_study

    loaded = load_study(study)
    require_output(out, *loaded.reads)
    interrupted = False
    with (
        tqdm(
            unit="step", file=sys.stderr, bar_format="{desc} [{elapsed}]", desc="candidates"
        ) as bar,
        mistakes_in(study),
    ):

        def progress(stage: str, gap: float) -> None:
            bar.set_description_str(stage if gap >= 1 else f"{stage}: gap {max(gap, 0.0):.1e}")

        try:
            plan = relax_study(
                loaded,
                name,
                candidates=candidates,
                continuous=continuous,
                memory_mb=memory,
                options=RunOptions(seed=seed, progress=progress),
            )
        except PlanInterrupted as interrupt:
            plan, interrupted = interrupt.best, True
    if out is not None:
        plan.to_csv(out)
    click.echo(json.dumps(plan.to_dict(), indent=2) if as_json else plan.summary())
    if interrupted:
        click.echo("edtk: interrupted; this is the best certified plan so far", err=True)
        sys.exit(130)
