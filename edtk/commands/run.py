"""`edtk run`: a whole study."""

import sys
from pathlib import Path

import click
from tqdm import tqdm

from edtk.commands.shared import (
    FilePath,
    dask_option,
    mistakes_in,
    require_output,
    team_of,
    workers_option,
)


@click.command("run")
@click.argument("study", type=FilePath)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder [default: results/STUDY].",
)
@workers_option
@dask_option
@click.option(
    "--fresh",
    is_flag=True,
    help="Begin anew, instead of going on from the cases that are finished.",
)
def command(
    study: Path, out: Path | None, workers: int | None, dask: str | None, fresh: bool
) -> None:
    """Answer STUDY (TOML): optimise plans, compare them, write tables, plans and a report.

    A run that was killed goes on where it was when it is started again.
    """
    from edtk.report.comparison_report import write_report
    from edtk.study.run_options import RunOptions
    from edtk.study.run_study import run_study, steps
    from edtk.study.study import load_study

    loaded = load_study(study)
    folder = out or Path("results") / study.stem
    require_output(folder / "report.md")
    with (
        team_of(workers, dask) as pool,
        tqdm(total=steps(loaded), unit="step", file=sys.stderr) as bar,
        mistakes_in(study),
    ):

        def progress(label: str, share: float) -> None:
            bar.set_postfix_str(label, refresh=False)
            bar.update()

        options = RunOptions(workers=pool, progress=progress)
        found = run_study(loaded, folder, fresh=fresh, options=options)
        write_report(loaded, found.table, dict(found.relaxations), folder)
    click.echo(
        f"wrote {folder / 'report.md'}, {folder / 'results.csv'} and {folder / 'plans'}", err=True
    )
