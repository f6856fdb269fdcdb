"""`edtk template`: an empty measurement file."""

from pathlib import Path

import click

from edtk.commands.shared import FilePath, require_output


@click.command("template")
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
    """A sheet to fill in while PLAN (CSV) is measured for STUDY (TOML).

    It has a row for each repetition, in an order in which the joints travel little; `edtk identify` reads it. Markers
    away from the tool point have their offsets from it, in the tool frame, in columns of their own.
    """
    from edtk.calibration.require_empty import require_empty
    from edtk.calibration.template import template, write_template
    from edtk.study.study import load_study

    loaded = load_study(study)
    measured = loaded.load_plan(plan)
    if out is not None:
        require_output(out, *loaded.reads, plan)
        require_empty(out)
    if measured.experiments > 1_000_000:
        raise click.UsageError(
            f"{plan}: {measured.experiments} experiments; expected 1000000 at most for a sheet"
        )
    table = template(loaded, measured, positions, markers or 0)
    if out is None:
        click.echo(table.to_csv(index=False, float_format="%.10g"), nl=False)
        return
    write_template(table, out)
