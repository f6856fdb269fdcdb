"""`edtk run`: a whole study."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

from edtk.commands.shared import (
    SHOWN_AFTER_S,
    FewLines,
    FilePath,
    FolderPath,
    budget_option,
    dask_option,
    time_until,
    warn,
    warn_about,
    workers_option,
)
from edtk.system.errors import shortened

BAR = "{percentage:3.0f} %|{bar}| [{elapsed}<{remaining}]{postfix}"


@contextmanager
def _progress() -> Iterator[Callable[[str, float], None]]:
    """A bar on standard error; a few lines where that is no terminal."""
    if not sys.stderr.isatty():
        lines = FewLines()
        yield lambda label, share: lines.say(f"{share:.0%}, {label}")
        return
    from tqdm import tqdm

    with tqdm(total=1.0, file=sys.stderr, bar_format=BAR, delay=SHOWN_AFTER_S) as bar:

        def progress(label: str, share: float) -> None:
            bar.set_postfix_str(label, refresh=False)
            bar.update(share - bar.n)

        yield progress


@click.command("run", short_help="Plan, compare and report a whole study.")
@click.argument("study", type=FilePath)
@click.option("--out", type=FolderPath, help="Folder [default: results/STUDY].")
@workers_option
@dask_option
@budget_option("Seconds for bounds, plans and report; the best so far are compared then.")
@click.option(
    "--fresh", is_flag=True, help="Begin anew, instead of going on from the finished cases."
)
def command(
    study: Path,
    out: Path | None,
    workers: int | None,
    dask: str | None,
    budget: float | None,
    fresh: bool,
) -> None:
    """Answer STUDY (TOML): optimise plans, compare them, write tables, plans and a report.

    A run that was killed, or whose budget was over, goes on from its finished cases when it is
    started again.
    """
    from edtk.report.views.study import expected_of_run
    from edtk.verbs.run import run

    with _progress() as progress:
        found = run(
            study,
            out,
            workers=workers,
            dask=dask,
            fresh=fresh,
            budget=time_until(budget),
            progress=progress,
        )
    warn_about(study, found.warnings)
    if found.ended == "budget":
        warn("the budget ended the run; these are the best plans so far, run again to go on")
    for text in expected_of_run(found):
        click.echo(text, err=True)
    folder = found.folder
    wrote = f"wrote {folder / 'report.md'}, {folder / 'results.csv'} and {folder / 'plans'}"
    click.echo(shortened(wrote), err=True)
