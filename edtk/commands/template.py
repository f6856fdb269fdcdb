"""`edtk template`: an empty measurement file."""

from pathlib import Path

import click

from edtk.commands.shared import FilePath, print_out, warn_about


@click.command("template", short_help="Make a sheet to fill in in the lab.")
@click.argument("study", type=FilePath)
@click.argument("plan", type=FilePath)
@click.option(
    "--positions",
    is_flag=True,
    help="Columns for unloaded and loaded positions, not displacements.",
)
@click.option(
    "--markers", type=click.IntRange(1, 100), help="Rows for so many markers in each repetition."
)
@click.option("--out", type=FilePath, help="Write the sheet (CSV) [default: print it].")
def command(
    study: Path, plan: Path, positions: bool, markers: int | None, out: Path | None
) -> None:
    """Make a sheet to fill in while PLAN (CSV) is measured for STUDY (TOML).

    It has a row for each repetition, in an order in which the joints travel little; `edtk identify`
    reads it. Markers away from the tool point have their offsets from it, in the tool frame, in
    columns of their own.
    """
    from edtk.measure.cells import csv_text
    from edtk.verbs.inputs import load_study
    from edtk.verbs.template import template

    question = load_study(study)
    doubts = question.warnings  # first: this reads excluded poses too, and may fail
    table = template(question, plan, positions=positions, markers=markers, out=out)
    if out is None:
        print_out(csv_text(table))
    warn_about(study, doubts)
