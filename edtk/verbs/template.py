"""`edtk.template` and `edtk.timetable`: the sheet of a plan, and the day on which it is filled."""

from pathlib import Path
from typing import TYPE_CHECKING

from edtk.system.arguments import checked
from edtk.system.errors import ArgumentError
from edtk.system.files import is_standard_output, write_text
from edtk.system.parsing import json_text
from edtk.verbs.inputs import (
    PlanLike,
    StudyLike,
    as_plan,
    errors_in,
    files_of,
    name_of,
    require_output,
)
from edtk.verbs.of_kinds import of_study

if TYPE_CHECKING:
    import pandas as pd

    from edtk.calibration.timetable import Day


@checked
def template(
    study: StudyLike,
    plan: PlanLike,
    *,
    positions: bool = False,
    markers: int | None = None,
    out: Path | str | None = None,
) -> "pd.DataFrame":
    """Make a sheet to fill in while a plan is measured.

    The poses are in an order in which the joints travel little.

    Args:
        study: A study, or the path of a study file.
        plan: The plan to measure, or the path of its CSV file.
        positions: Whether unloaded and loaded positions are measured, instead of displacements.
        markers: Number of markers on the tool, each with rows of its own; defaults to one marker
            at the tool point.
        out: File to write the sheet to (CSV), "-" for standard output; an empty sheet is replaced,
            anything else is not.

    Returns:
        A row for each repetition; headers name the units, cells to fill in are empty.

    Raises:
        UserError: A file is not valid, the plan is too long, or `out` holds something else.
    """
    question = of_study(study)
    question.require("template", markers=markers, positions=positions)
    return question.template(plan, positions, markers, out)


@checked
def timetable(study: StudyLike, plan: PlanLike, *, out: Path | str | None = None) -> "Day":
    """Find out when the visits of a plan are made, in the order of its sheet.

    Args:
        study: A study, or the path of a study file; with [scene], or with times in [costs].
        plan: The plan to measure, or the path of its CSV file.
        out: File to write the steps to: JSON where its name ends in .json, else CSV; "-" for
            standard output.

    Returns:
        The steps with the clock, and the ways that the arm takes.

    Raises:
        UserError: A file is not valid, or the study says neither how long things take nor what
            stands around the robot.
    """
    from edtk.measure.cells import csv_text

    question = of_study(study)
    measured = as_plan(question.study, plan)
    if out is not None and not is_standard_output(out):
        require_output(out, *question.study.reads, *files_of(plan))
    with errors_in(name_of(plan, "plan")):
        day = question.timetable(measured)
    if day is None:
        message = "expected [scene] in the study, or times in [costs], such as dwell_s"
        raise ArgumentError(message, argument="timetable")
    if out is not None:
        as_json = Path(out).suffix.lower() == ".json"
        write_text(out, json_text(day.to_dict()) if as_json else csv_text(day.to_frame()))
    return day
