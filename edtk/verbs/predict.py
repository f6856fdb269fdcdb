"""`edtk.predict`: what instruments will read in other poses, with 95 % bands."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from edtk.calibration.calibration import Calibration
from edtk.calibration.geometry.geometric_calibration import GeometricCalibration
from edtk.calibration.prediction import Prediction
from edtk.system.arguments import checked
from edtk.system.errors import whole_number
from edtk.verbs.inputs import PlanLike, StudyLike
from edtk.verbs.of_kinds import of_study


@checked
def predict(
    study: StudyLike,
    result: Calibration | GeometricCalibration | Mapping[str, Any] | Path | str,
    poses: PlanLike,
    *,
    tool_rows: int = 0,
    out: Path | str | None = None,
) -> Prediction:
    """Predict readings in other poses, with bands; where they were measured, compare.

    Args:
        study: The study of the calibration, or the path of its file. Of one with [parameters]
            positions of markers are predicted, of another one displacements under load.
        result: A calibration of it, its `to_dict`, or the path of its JSON file.
        poses: A plan, or the poses (CSV, or a data frame) with their loads, and with readings as in
            a sheet where they were measured: these are tests.
        tool_rows: Of positions, so many rows at the beginning tell where each marker sits on the
            tool, where that is not where it sat before; they are no tests.
        out: File to write the predictions to (CSV); "-" is standard output.

    Returns:
        Readings with bands, errors where they were measured, and the share inside the bands.

    Raises:
        UserError: A file is not valid, or of another study; one line says why.
    """
    question = of_study(study)
    tool_rows = whole_number(tool_rows, "tool_rows", 0)
    question.require("predict", tool_rows=tool_rows or None)
    return question.predict(result, poses, tool_rows, out)
