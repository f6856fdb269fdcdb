"""The command `edtk`: thin, JSON alone on standard output, messages on standard error."""

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click
from tqdm import tqdm

import criteria
import edtk
from edtk.atomic import require_writable
from edtk.commands import bayes, bias, compensate, identify, template
from edtk.errors import UserError
from edtk.one_line import OneLine

if TYPE_CHECKING:
    from edtk.parallel import Team

StudyPath = click.Path(path_type=Path, dir_okay=False)


class _Group(OneLine, click.Group):
    """The program: a group of commands that answer mistakes with one line."""


@contextmanager
def _mistakes(where: Path) -> Iterator[None]:
    """Name the file in mistakes that only show in the arithmetic, or in the file system."""
    from edtk.inference import SingularPlanError

    try:
        yield
    except SingularPlanError as error:
        raise UserError(f"{where}: {error}") from error
    except OSError as error:
        raise UserError(f"{error.filename or where}: {error.strerror or error}") from error


workers_option = click.option(
    "--workers", type=click.IntRange(min=1), help="Processes on this machine [default: one a core]."
)
dask_option = click.option("--dask", metavar="ADDRESS", help="Use the workers of a Dask cluster, tcp://HOST:PORT.")


@contextmanager
def _team(workers: int | None, dask: str | None) -> Iterator["Team"]:
    """Who does the work; a cluster that is not there is the user's mistake."""
    from edtk.parallel import WorkersLostError, team

    try:
        with team(workers, dask) as found:
            yield found
    except WorkersLostError as error:
        raise UserError(f"--dask: {error}") from error


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]}, no_args_is_help=False)
@click.version_option(edtk.__version__, prog_name="edtk")
def main() -> None:
    """Design calibration experiments, and say how good the design is."""


@main.command("criteria")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def list_criteria(as_json: bool) -> None:
    """List the criteria that are there, built in or from plug-ins."""
    rows = [criteria.get(name).describe() for name in criteria.available()]
    if as_json:
        click.echo(json.dumps(rows, indent=2))
        return
    click.echo(f"{'name':6}{'sense':6}{'convex':8}{'title':32}formula")
    for r in rows:
        convex = "yes" if r["convex"] else "no"
        click.echo(f"{r['name']:6}{r['sense']:6}{convex:8}{r['title']:32}{r['formula']}")


@main.command("evaluate")
@click.argument("study", type=StudyPath)
@click.argument("plan", type=StudyPath)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, in SI units.")
def evaluate_plan(study: Path, plan: Path, as_json: bool) -> None:
    """Score PLAN (CSV) under every criterion of STUDY (TOML)."""
    from edtk.study import evaluate, load_study

    loaded = load_study(study)
    with _mistakes(plan):
        result = evaluate(loaded, loaded.load_plan(plan))
    if as_json:
        click.echo(json.dumps(result.to_json(), indent=2))
        return
    click.echo(f"{result.experiments} experiments")
    for name, value in result.criteria.items():
        cls = criteria.get(name)
        shown = f"{1e3 * value:.6g} mm" if name == "rho0" else f"{value:.6g}"
        click.echo(f"  {name:6}{cls.sense:5}{shown:18}{cls.formula}")
    click.echo("standard deviations")
    for name, std in zip(result.parameters, result.std, strict=True):
        click.echo(f"  {name:6}{std:.4g} rad/(N m)")


@main.command("run")
@click.argument("study", type=StudyPath)
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), help="Folder [default: results/STUDY].")
@workers_option
@dask_option
@click.option("--fresh", is_flag=True, help="Begin anew, instead of going on from the cases that are finished.")
def run(study: Path, out: Path | None, workers: int | None, dask: str | None, fresh: bool) -> None:
    """Answer STUDY (TOML): optimise plans, compare them, write tables, plans and a report.

    A run that was killed goes on where it was when it is started again.
    """
    from edtk.study import load_study, run_study
    from edtk.study.runner import steps

    loaded = load_study(study)
    folder = out or Path("results") / study.stem
    with (
        _team(workers, dask) as team,
        tqdm(total=steps(loaded), unit="step", file=sys.stderr) as bar,
        _mistakes(study),
    ):

        def progress(label: str) -> None:
            bar.set_postfix_str(label, refresh=False)
            bar.update()

        run_study(loaded, folder, progress, team, fresh)
    click.echo(f"wrote {folder / 'report.md'}, {folder / 'results.csv'} and {folder / 'plans'}", err=True)


@main.command("plan")
@click.argument("study", type=StudyPath)
@click.option("--size", type=click.IntRange(min=1), required=True, help="Number of experiments m, kept ones counted.")
@click.option("--distinct", type=click.IntRange(min=1), help="Distinct new poses at most [default: any number].")
@click.option("--criterion", "name", help="Criterion to optimise [default: the first that the study optimises].")
@click.option("--keep", type=StudyPath, help="Plan (CSV) of experiments that are there already.")
@click.option("--exclude", type=StudyPath, help="Plan (CSV) of poses to stay away from.")
@click.option("--budget", type=click.FloatRange(min=0, min_open=True), help="Seconds after which to stop.")
@workers_option
@dask_option
@click.option("--seed", type=click.IntRange(min=0), help="Seed [default: the study's].")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="Write all experiments (CSV).")
def plan_study(
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
    from edtk.study import load_study
    from edtk.study.planned import planned

    loaded = load_study(study, exclude)
    kept = loaded.load_plan(keep) if keep is not None else None
    if out is not None:
        require_writable(out)
    with (
        _team(workers, dask) as team,
        tqdm(unit="step", file=sys.stderr, bar_format="{desc} [{elapsed}]", desc="bound") as bar,
        _mistakes(study),
    ):
        name = loaded.file.optimise[0] if name is None else name
        found = planned(loaded, size, name, distinct, kept, budget, seed, team, bar.set_description_str)
    if out is not None:
        found.whole.to_csv(out, loaded.robot)
    click.echo(json.dumps(found.to_json(), indent=2) if as_json else found.summary())
    if found.ended in ("budget", "interrupted"):
        why = "the budget ended the search" if found.ended == "budget" else "interrupted"
        click.echo(f"edtk: {why}; this is the best plan so far", err=True)
    if found.ended == "interrupted":
        sys.exit(130)


@main.command("relax")
@click.argument("study", type=StudyPath)
@click.option("--criterion", "name", help="Criterion to optimise [default: the first that the study optimises].")
@click.option("--candidates", type=click.IntRange(min=1), help="Candidate poses [default: the study's].")
@click.option("--continuous", is_flag=True, help="Leave the candidates: search over all feasible poses.")
@click.option("--seed", type=click.IntRange(min=0), help="Seed [default: the study's].")
@click.option("--memory", type=click.FloatRange(min=0), default=1000, show_default=True, help="Limit on memory [MB].")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="Write poses and weights (CSV).")
def relax_study(
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
    from edtk.design import PlanInterrupted
    from edtk.study import load_study
    from edtk.study.relaxed import relaxed_plan

    loaded = load_study(study)
    if out is not None:
        require_writable(out)
    interrupted = False
    with (
        tqdm(unit="step", file=sys.stderr, bar_format="{desc} [{elapsed}]", desc="candidates") as bar,
        _mistakes(study),
    ):

        def progress(stage: str, gap: float) -> None:
            bar.set_description_str(stage if gap >= 1 else f"{stage}: gap {max(gap, 0.0):.1e}")

        try:
            plan = relaxed_plan(
                loaded,
                loaded.file.optimise[0] if name is None else name,
                candidates,
                seed,
                continuous,
                memory_mb=memory,
                progress=progress,
            )
        except PlanInterrupted as interrupt:
            plan, interrupted = interrupt.best, True
    if out is not None:
        plan.to_csv(out)
    click.echo(json.dumps(plan.to_json(), indent=2) if as_json else plan.summary())
    if interrupted:
        click.echo("edtk: interrupted; this is the best certified plan so far", err=True)
        sys.exit(130)


main.add_command(bayes.command)
main.add_command(bias.command)
main.add_command(compensate.command)
main.add_command(identify.command)
main.add_command(template.command)
