"""`edtk compensate`: commands that make up for the deflection under the task's load."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from edtk.commands.shared import FilePath, end_partial, json_option, show, warn, warn_about

if TYPE_CHECKING:
    from edtk.calibration.compensate import Compensation
    from edtk.calibration.correct_program import CorrectedProgram


@click.command("compensate", short_help="Correct commands, or a program, for the load.")
@click.argument("study", type=FilePath)
@click.argument("k", type=FilePath, metavar="K.json")
@click.argument("task", type=FilePath, required=False)
@json_option
@click.option("--out", type=FilePath, help="Write commands (CSV), or the program; - to print.")
@click.option("--table", type=FilePath, help="Write what moved in a program (CSV, - to print).")
@click.option("--all-literals", is_flag=True, help="Also correct targets in blocks of a program.")
def command(
    study: Path,
    k: Path,
    task: Path | None,
    as_json: bool,
    out: Path | None,
    table: Path | None,
    all_literals: bool,
) -> None:
    """Compute joint angles to command, so that the loaded robot is where TASK (CSV) wants it.

    K.json holds the compliances, as `edtk identify` writes them. The tool is that of the test pose
    of STUDY (TOML); so is the load where TASK has no wrench columns. Without TASK the poses are the
    study's own: its test poses, each with its own tool and payload, or its path.

    Of a study with [parameters], K.json is its result, and commands correct for geometry and load:
    the tool of the test pose, or without one the markers, are brought where the robot of the
    drawing would have them in these poses.

    Rows without a command, as it would be out of limits, are named and left out, and the exit code
    is then 1; the column row says which rows the others are.

    TASK may be a robot program: KRL (.src, .dat), RAPID (.mod, .prg), URScript (.script,
    .urscript) or FANUC's .ls. Its targets are corrected, all else stays byte for byte. Targets that
    are computed at run time, or that stand in conditionals and loops, stay and are listed; the exit
    code is then 1. --all-literals corrects those in conditionals and loops, too.
    """
    from edtk.calibration.compensate import Compensation
    from edtk.verbs.identify import compensate

    found = compensate(study, k, task, out=out, table=table, all_literals=all_literals)
    if found.verdict == "bad":
        warn(
            "the calibration says not to use these compliances; "
            "its error band is not to be trusted",
            k,
        )
    warn_about(task or study, found.findings)
    show(found, as_json, out, table)
    lines = _left(found) if isinstance(found, Compensation) else _left_in_program(found)
    if lines:
        # A line each: one of them all would be longer than a line may be, and be cut.
        for line in lines:
            warn(line, task or study)
        end_partial()


def _left(found: "Compensation") -> tuple[str, ...]:
    """How many rows are left out, and why."""
    from edtk.calibration.tasks_in_use import refused_lines

    return refused_lines(found.refused)


def _left_in_program(found: "CorrectedProgram") -> tuple[str, ...]:
    """What is left as it is, a line each."""
    return tuple(one.text for one in found.left)
