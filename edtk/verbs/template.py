"""A plan to carry out: its sheet, the day on which that is filled in, and the robot's program.

`edtk.template`, `edtk.timetable` and `edtk.program`.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from edtk.calibration.robot_program import (
    DWELL_S,
    SPEED,
    Driven,
    Vias,
    Visits,
    WrittenProgram,
    as_taken,
    home_taken,
    program_axes,
    require_free,
    stations_of,
    steps_of,
    vias_of,
)
from edtk.measure.pose_table import pose_factors
from edtk.programs import writer as writers
from edtk.programs.program import Axis, Program
from edtk.programs.writer import Writer
from edtk.study.study import Study
from edtk.system.arguments import checked
from edtk.system.errors import ArgumentError
from edtk.system.files import is_standard_output, write_files, write_text
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
    question = of_study(study)
    measured = as_plan(question.study, plan)
    require_output(out, *question.study.reads, *files_of(plan))
    with errors_in(name_of(plan, "plan")):
        day = question.timetable(measured)
    if day is None:
        message = "expected [scene] in the study, or times in [costs], such as dwell_s"
        raise ArgumentError(message, argument="timetable")
    if out is not None:
        write_timetable(day, out)
    return day


def write_timetable(day: "Day", out: Path | str) -> None:
    """Write the steps of a day: JSON where the file's name ends in .json, else CSV."""
    from edtk.measure.cells import csv_text

    as_json = Path(out).suffix.lower() == ".json"
    write_text(out, json_text(day.to_dict()) if as_json else csv_text(day.to_frame()))


@checked
def program(
    study: StudyLike,
    plan: PlanLike,
    writer: str,
    *,
    markers: int | None = None,
    speed: float = SPEED,
    dwell: float = DWELL_S,
    handshake: Sequence[str] | None = None,
    home: Sequence[float] | None = None,
    axes: str | None = None,
    out: Path | str | None = None,
) -> WrittenProgram:
    """Write the program of a robot that drives through a plan, in the order of `edtk.template`.

    Each row of the sheet has its number in a comment of the program. Angles are what the controller
    shows, as it takes them; the plan is judged as rounded.

    Args:
        study: A study, or the path of a study file.
        plan: The plan to measure, or the path of its CSV file.
        writer: Brand: "krl", "rapid", "urscript", "fanuc_ls", "csv", or a package's.
        markers: As of `edtk.template`: so many rows are read in each visit.
        speed: Speed of the joint moves, in percent of what the joints can.
        dwell: Rest before each reading [s].
        handshake: Names of the digital output that asks for a reading and of the input that tells
            that it is done; without them the program stops until an operator starts it again.
        home: Where the program begins and ends, as the controller shows it [deg or mm].
        axes: The controller's axes of the joints, such as "E1,1,2,3,4,5,6".
        out: File to write; others of the brand go beside it. "-" is standard output.

    Returns:
        The program with its text, and the efficiency of the plan as rounded.

    Raises:
        UserError: A file is not valid, or the controller takes no such program.
    """
    question = of_study(study)
    brand = writers.get(writer)
    robot = question.study.robot
    measured = as_plan(question.study, plan)
    files = program_files(question.study, plan, writer, out)
    table = template(question.study, measured, markers=markers)
    with errors_in(name_of(plan, "plan")):
        named = program_axes(robot, axes)
        visits = Visits.of(question.study, table, brand, named)
        day = question.timetable(measured)
        if day is not None and day.in_a_cell:
            require_free(day)
        vias, at_home = _ways_and_home(question.study, day, brand, named, home)
        signals = None if handshake is None else _pair(handshake)
        driven = Driven(speed, dwell, signals, at_home, axes)
        name = Path(files[brand.suffixes[0]]).stem
        heading = (
            f"poses of {name_of(plan, 'plan').name}, study {Path(question.study.where).name}",
            f"{len(table)} rows of the sheet",
        )
        stations = None if day is None else stations_of(day)
        steps = steps_of(visits, driven, vias, stations)
        made = Program(name, named, steps, speed, heading)
        texts = {files[suffix].name: text for suffix, text in brand.files(made).items()}
    rounded = as_taken(robot, brand, named, measured)
    change = (robot.shown(rounded.q) - robot.shown(measured.q)) / pose_factors(robot)
    criterion, efficiency = question.efficiency(rounded, measured)
    found = WrittenProgram(
        program=made,
        brand=brand.name,
        title=brand.title,
        files=texts,
        rows=len(table),
        criterion=criterion,
        efficiency=efficiency,
        rounding=float(np.abs(change).max()),
    )
    if out is not None:
        _write(found, files, out)
    return found


def program_files(
    study: Study, plan: PlanLike, writer: str, out: Path | str | None
) -> dict[str, Path]:
    """The file of each ending of a program, which are checked before long work.

    Raises:
        UserError: No writer has this name, or a file is none that can be written.
    """
    files = _paths(writers.get(writer), out, name_of(plan, "plan"))
    for path in files.values() if out is not None and not is_standard_output(out) else ():
        require_output(path, *study.reads, *files_of(plan))
    return files


def _ways_and_home(
    study: Study,
    day: "Day | None",
    brand: Writer,
    axes: Sequence[Axis],
    home: Sequence[float] | None,
) -> tuple[Vias | None, tuple[float, ...] | None]:
    """Via poses of ways, and where a program begins and ends, as the controller takes both.

    That is the study's home, to which ways are proved, or another one, to which none leads.
    """
    robot = study.robot
    vias = None if day is None else vias_of(day, robot, brand, axes, day.order.tolist())
    if home is None:
        if study.home is None:
            return vias, None
        home = (robot.shown(study.home) / pose_factors(robot)).tolist()
    elif vias is not None:
        vias = {places: via for places, via in vias.items() if None not in places}
    return vias, tuple(home_taken(robot, brand, axes, home).tolist())


def _paths(brand: Writer, out: Path | str | None, plan: Path) -> dict[str, Path]:
    """The file of each ending: beside `out`, or without one named after the plan.

    Raises:
        ArgumentError: The file ends otherwise.
    """
    main = brand.suffixes[0]
    if out is None or is_standard_output(out):
        plain = re.sub(r"\W+", "_", plan.stem, flags=re.ASCII).strip("_")
        name = plain if plain[:1].isalpha() else f"plan_{plain}".rstrip("_")
        return {suffix: Path(name[: brand.longest_name] + suffix) for suffix in brand.suffixes}
    path = Path(out)
    if path.suffix.lower() not in ("", main):
        message = f"expected a file that ends in {main}, as {brand.title} has it"
        raise ArgumentError(message, argument="out", given=str(out))
    return {suffix: path.with_suffix(suffix) for suffix in brand.suffixes}


def _pair(signals: Sequence[str]) -> tuple[str, str]:
    """An output and an input.

    Raises:
        ArgumentError: They are not two.
    """
    names = [str(name).strip() for name in signals]
    if isinstance(signals, str) or len(names) != 2:
        message = "expected two signals: the output that asks, and the input that answers"
        raise ArgumentError(message, argument="handshake", given=signals)
    return names[0], names[1]


def _write(found: WrittenProgram, files: dict[str, Path], out: Path | str) -> None:
    """Write all files or none; on standard output they come one after another."""
    texts = {path: found.files[path.name] for path in files.values()}
    if is_standard_output(out):
        texts = {Path(out): "".join(texts.values())}
    write_files(texts)
