"""`edtk compensate`: commands that make up for the deflection under the task's load."""

from pathlib import Path

import click

from edtk.commands.shared import FilePath, end_partial, json_option, show, warn, warn_about


@click.command("compensate", short_help="Correct commands for the load.")
@click.argument("study", type=FilePath)
@click.argument("k", type=FilePath, metavar="K.json")
@click.argument("task", type=FilePath, required=False)
@json_option
@click.option("--out", type=FilePath, help="Write commands and errors (CSV, - to print).")
def command(study: Path, k: Path, task: Path | None, as_json: bool, out: Path | None) -> None:
    """Compute joint angles to command, so that the loaded robot is where TASK (CSV) wants it.

    K.json holds the compliances, as `edtk identify` writes them. The tool is that of the test pose
    of STUDY (TOML); so is the load where TASK has no wrench columns. Without TASK the poses are the
    study's own: its test poses, each with its own tool and payload, or its path.

    Of a study with [parameters], K.json is its result, and commands correct for geometry and load:
    the tool of the test pose, or without one the markers, are brought where the robot of the
    drawing would have them in these poses.

    Rows without a command, as it would be out of limits, are named and left out, and the exit code
    is then 1; the column row says which rows the others are.
    """
    from edtk.calibration.tasks_in_use import refused_lines
    from edtk.verbs.compensate import compensate

    found = compensate(study, k, task, out=out)
    if found.verdict == "bad":
        warn(
            "the calibration says not to use these compliances; "
            "its error band is not to be trusted",
            k,
        )
    warn_about(task or study, found.findings)
    show(found, as_json, out)
    if found.refused:
        # A line each: one of them all would be longer than a line may be, and be cut.
        for line in refused_lines(found.refused):
            warn(line, task or study)
        end_partial()
