"""`edtk.predict`: where markers will be in other poses, with 95 % bands."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from edtk.calibration.geometry.geometric_calibration import GeometricCalibration
from edtk.calibration.geometry.prediction import Prediction
from edtk.verbs.inputs import PlanLike, StudyLike
from edtk.verbs.of_kinds import of_study


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
    return of_study(study).predict(result, poses, tool_rows, out)
