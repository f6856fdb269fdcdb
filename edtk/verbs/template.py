"""`edtk.template`: the sheet on which measurements are written down."""

from pathlib import Path
from typing import TYPE_CHECKING

from edtk.calibration.template import require_empty, write_template
from edtk.calibration.template import template as empty_sheet
from edtk.study.study import Study
from edtk.system.errors import ArgumentError, UserError
from edtk.system.files import is_standard_output
from edtk.verbs.inputs import (
    PlanLike,
    StudyLike,
    as_plan,
    as_study,
    files_of,
    name_of,
    require_output,
)

if TYPE_CHECKING:
    import pandas as pd

MOST_ROWS = 1_000_000


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
    question = as_study(study)
    _require_own(question, markers)
    geometry = question.specification.parameters is not None
    if geometry and positions:
        message = "a sheet of a study of geometry has positions anyway; leave this out"
        raise ArgumentError(message, argument="positions")
    measured = as_plan(question, plan)
    if out is not None and not is_standard_output(out):
        require_output(out, *question.reads, *files_of(plan))
        require_empty(Path(out))
    rows = measured.experiments * (markers or _rows_of_visit(question))
    if rows > MOST_ROWS:
        raise UserError(
            f"a sheet of {rows} rows, one for each repetition and marker; "
            f"expected {MOST_ROWS} at most",
            where=name_of(plan, "plan"),
        )
    if geometry:
        from edtk.calibration.geometry_design.geometry_plan import position_sheet

        table = position_sheet(question, measured)
    else:
        table = empty_sheet(question, measured, positions, markers or 0)
    if out is not None:
        write_template(table, out)
    return table


def _rows_of_visit(study: Study) -> int:
    """Rows of the sheet for each visit: one an instrument, reference points included."""
    return max(len(study.specification.marker), len(study.model.instruments))


def _require_own(study: Study, markers: int | None) -> None:
    """Check that markers are not counted where the study has instruments of its own.

    Raises:
        ArgumentError: They are.
    """
    sensors = study.model.sensors
    if study.specification.parameters is not None and markers is not None:
        message = "the markers of a study of geometry are its [[marker]]; leave this out"
        raise ArgumentError(message, argument="markers", given=markers)
    if sensors and markers is not None:
        message = f"the study has {len(sensors)} instruments of its own; leave this out"
        raise ArgumentError(message, argument="markers", given=markers)
