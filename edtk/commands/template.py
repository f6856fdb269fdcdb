"""`edtk template`: an empty measurement file, or the program of a robot that fills it."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from edtk.commands.shared import (
    FilePath,
    Range,
    Whole,
    json_option,
    print_out,
    show,
    warn,
    warn_about,
)
from edtk.system.errors import ArgumentError

if TYPE_CHECKING:
    from edtk.calibration.timetable import Day
    from edtk.study.study import Study


@click.command("template", short_help="Make a sheet to fill in in the lab, or a robot program.")
@click.argument("study", type=FilePath)
@click.argument("plan", type=FilePath)
@click.option(
    "--positions",
    is_flag=True,
    help="Columns for unloaded and loaded positions, not displacements.",
)
@click.option("--markers", type=Whole(1, 100), help="Rows for so many markers in each repetition.")
@click.option(
    "--program",
    "writer",
    metavar="NAME",
    help="Write a robot program: krl, rapid, urscript, fanuc_ls or csv.",
)
@click.option(
    "--speed",
    type=Range(min=0, max=100, min_open=True),
    help="With --program: speed of the joints, in percent.  [default: 20]",
)
@click.option(
    "--dwell", type=Range(min=0), help="With --program: rest before a reading [s].  [default: 2]"
)
@click.option(
    "--handshake",
    metavar="OUT,IN",
    help="With --program: digital output and input for readings [default: stop for an operator].",
)
@click.option(
    "--home",
    metavar="VALUES",
    help="With --program: where it begins and ends, as the controller shows it [deg or mm].",
)
@click.option(
    "--axes", metavar="AXES", help="With --program: axes of the joints, like E1,1,2,3,4,5,6."
)
@click.option(
    "--timetable",
    type=FilePath,
    help="Write when what is visited, too (CSV, or JSON as .json), where the study has times.",
)
@json_option
@click.option("--out", type=FilePath, help="Write the sheet (CSV) or program [default: print it].")
def command(
    study: Path,
    plan: Path,
    positions: bool,
    markers: int | None,
    writer: str | None,
    timetable: Path | None,
    as_json: bool,
    out: Path | None,
    **of_program: float | str | None,
) -> None:
    """Make a sheet to fill in while PLAN (CSV) is measured for STUDY (TOML).

    It has a row for each repetition, in an order in which the joints travel little; `edtk identify`
    reads it. Markers away from the tool point have their offsets from it, in the tool frame, in
    columns of their own.

    With --program, write what drives the robot through the rows of that sheet instead, each with
    its number in a comment.
    """
    from edtk.measure.cells import csv_text
    from edtk.verbs.inputs import load_study, require_output
    from edtk.verbs.template import program_files, template

    given = {name: value for name, value in of_program.items() if value is not None}
    _require_one(writer, positions, as_json, given)
    question = load_study(study)
    doubts = question.warnings  # first: this reads excluded poses too, and may fail
    require_output(timetable, *question.reads, plan)
    if writer is None:
        require_output(out, *question.reads, plan)
    else:
        program_files(question, plan, writer, out)
    day = _day(question, plan, timetable)
    if writer is None:
        table = template(question, plan, positions=positions, markers=markers, out=out)
        if out is None:
            print_out(csv_text(table))
    else:
        from edtk.verbs.template import program

        found = program(question, plan, writer, markers=markers, out=out, **_as_called(given))
        if out is None and not as_json:
            print_out("".join(found.files.values()))
        else:
            show(found, as_json, out)
    if day is not None:
        _tell_of_the_day(day, plan, timetable, quiet=out is None or as_json)
    warn_about(study, doubts)


def _day(question: "Study", plan: Path, out: Path | None) -> "Day | None":
    """The day, where the study has one or a timetable is asked for."""
    from edtk.calibration.timetable import has_day
    from edtk.verbs.template import timetable

    return timetable(question, plan) if out is not None or has_day(question) else None


def _tell_of_the_day(day: "Day", plan: Path, out: Path | None, quiet: bool) -> None:
    """Write the timetable where one is asked for, and say which legs have no free way."""
    from edtk.report.views.day import blocked_in_words
    from edtk.verbs.template import write_timetable

    if out is not None:
        write_timetable(day, out)
        if not quiet:
            show(day, False, out)
    for line in blocked_in_words(day):
        warn(line, plan)


def _require_one(
    writer: str | None, positions: bool, as_json: bool, given: dict[str, float | str]
) -> None:
    """Check that options are of a sheet alone, or of a program alone.

    Raises:
        ArgumentError: One is of the other.
    """
    if writer is None:
        for name in (*given, *(("json",) if as_json else ())):
            raise ArgumentError("is of programs; expected --program beside it", argument=name)
    elif positions:
        message = "is of sheets, and a program has no columns; leave this out"
        raise ArgumentError(message, argument="positions")


def _as_called(given: dict[str, float | str]) -> dict[str, Any]:
    """The options as `edtk.program` takes them.

    Raises:
        ArgumentError: A home pose has what is no number.
    """
    found: dict[str, Any] = dict(given)
    if "handshake" in given:
        found["handshake"] = str(given["handshake"]).split(",")
    if "home" in given:
        try:
            found["home"] = [float(value) for value in str(given["home"]).split(",")]
        except ValueError:
            message = "expected numbers, separated by commas"
            raise ArgumentError(message, argument="home", given=given["home"]) from None
    return found
