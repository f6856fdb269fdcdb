"""`edtk predict`: what instruments will read in other poses."""

from pathlib import Path

import click

from edtk.commands.shared import FilePath, Whole, json_option, show, warn_about


@click.command("predict", short_help="Predict readings in other poses, with bands.")
@click.argument("study", type=FilePath)
@click.argument("result", type=FilePath)
@click.argument("poses", type=FilePath)
@click.option(
    "--tool-rows",
    type=Whole(min=0),
    default=0,
    help="So many rows at the beginning of POSES place the markers on the tool anew.",
)
@json_option
@click.option("--out", type=FilePath, help="Write readings and bands (CSV); - is standard output.")
def command(
    study: Path, result: Path, poses: Path, tool_rows: int, as_json: bool, out: Path | None
) -> None:
    """Predict what instruments read in POSES (CSV), with 95 % bands.

    RESULT is what edtk identify --json printed for STUDY (TOML), or its k.json. Where STUDY has a
    table [parameters], positions of markers are predicted: POSES has a pose a row, or a row a
    marker, as a sheet of positions. Otherwise displacements under the loads of POSES are, a plan or
    a sheet. Where POSES holds readings (x_mm y_mm z_mm, or dx_mm dy_mm dz_mm), these are tests:
    errors are printed, and the share inside the bands.
    """
    from edtk.verbs.identify import predict
    from edtk.verbs.inputs import as_study

    question = as_study(study)
    found = predict(question, result, poses, tool_rows=tool_rows, out=out)
    show(found, as_json, out)
    warn_about(study, question.warnings)
    warn_about(poses, found.findings)
