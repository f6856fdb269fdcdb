"""`edtk show`: a page with the poses of a plan."""

from pathlib import Path

import click

from edtk.commands.shared import FilePath, warn_about


@click.command("show", short_help="Make a page with pictures of every pose.")
@click.argument("study", type=FilePath)
@click.argument("poses", type=FilePath, required=False, metavar="[PLAN|SHEET|RESULT]")
@click.option("--out", type=FilePath, required=True, help="Write the page (HTML) there.")
def command(study: Path, poses: Path | None, out: Path) -> None:
    """Make a page on which one looks at each pose of a PLAN (CSV) for STUDY (TOML).

    In place of a plan it takes a SHEET (CSV), whose poses are coloured by their residuals where it
    is filled in, or the RESULT (k.json) of `edtk identify`. Without either the page shows the test
    poses of STUDY. The page is one file, which asks no network for anything.
    """
    from edtk.verbs.inputs import load_study
    from edtk.verbs.show import show

    question = load_study(study)
    show(question, poses, out=out)
    warn_about(study, question.warnings)
