"""`edtk.predict`: where markers will be in other poses, with 95 % bands."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from edtk.calibration.geometry.geometric_calibration import GeometricCalibration, read_result
from edtk.calibration.geometry.prediction import Prediction, predict_positions
from edtk.design.plan import REPEATS
from edtk.measure.cells import csv_text
from edtk.system.files import write_files
from edtk.verbs.inputs import (
    PlanLike,
    StudyLike,
    as_study,
    as_table,
    files_of,
    name_of,
    plan_of,
    require_output,
)


def predict(
    study: StudyLike,
    result: "GeometricCalibration | Mapping[str, Any] | Path | str",
    poses: PlanLike,
    *,
    tool_rows: int = 0,
    out: Path | str | None = None,
) -> Prediction:
    """Predict positions of markers in poses, with bands; where they were measured, compare.

    Args:
        study: A study with [parameters], or the path of its file.
        result: A calibration of it, its `to_dict`, or the path of its JSON file.
        poses: A plan, or the poses (CSV, or a data frame), with positions as in a sheet where they
            were measured.
        tool_rows: So many rows at the beginning tell where each marker sits on the tool, where
            that is not where it sat before; they are no tests.
        out: File to write the predictions to (CSV); "-" is standard output.

    Returns:
        Positions with bands, errors where positions were measured, and the share inside the bands.

    Raises:
        UserError: A file is not valid, or of another study; one line says why.
    """
    question = as_study(study)
    if question.specification.parameters is None:
        raise question.error(
            "parameters", "predictions need a study of geometry; expected a table [parameters]"
        )
    require_output(out, *question.reads, *files_of(result, poses))
    plan = plan_of(question, poses, "poses")
    if plan is None:
        table = as_table(poses, "poses")
    else:
        table = plan.to_frame(question.robot).drop(columns=REPEATS)
    where = name_of(result, "result")
    content = read_result(result)
    found = predict_positions(question, content["geometry"], where, table, tool_rows)
    if out is not None:
        write_files({Path(out): csv_text(found.to_frame())})
    return found
