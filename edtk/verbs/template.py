"""`edtk.template`: the sheet on which measurements are written down."""

from pathlib import Path
from typing import TYPE_CHECKING

from edtk.verbs.inputs import PlanLike, StudyLike
from edtk.verbs.of_kinds import of_study

if TYPE_CHECKING:
    import pandas as pd


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
