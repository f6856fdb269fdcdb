"""The fitted geometry of a result, as a study reads it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from edtk.calibration.geometry.counting import Counting
from edtk.calibration.geometry.geometry_to_dict import geometry_of_dict
from edtk.calibration.geometry.study_geometry import StudyGeometry
from edtk.calibration.geometry.study_marks import study_marks
from edtk.inference.geometry.fitted_geometry import FittedGeometry
from edtk.study.study import Study
from edtk.system.errors import UserError

SAME = 1e-6  # relative difference of marks that rounding may leave
OTHERWISE = {
    "shown": "the study's controller counts joints otherwise than when the result was made",
    "loads": "the study's load point, payload or masses are not those of the result",
}


def read_geometry(
    study: Study, geometry: Mapping[str, Any], where: Path | str
) -> tuple[StudyGeometry, FittedGeometry, Counting]:
    """The setting, the fitted geometry, and how its sheet counted the joints.

    Args:
        study: The study of the calibration.
        geometry: The table `geometry` of its result.
        where: The result, for messages.

    Raises:
        UserError: The table is not valid, or of another study.
    """
    setting = StudyGeometry.of_result(study, geometry.get("markers"))
    try:
        fitted, counting = geometry_of_dict(geometry, setting)
    except ValueError as error:
        raise UserError(str(error), where=where, key="geometry") from error
    _require_same(geometry.get("study", {}), setting, where)
    return setting, fitted, counting


def _require_same(given: object, setting: StudyGeometry, where: Path | str) -> None:
    """Check the marks of the study; older results have none.

    Raises:
        UserError: One differs.
    """
    if not isinstance(given, Mapping):
        raise UserError("expected a table", where=where, key="geometry.study")
    for name, own in study_marks(setting).items():
        if name not in given:
            continue
        try:
            mark = np.array(given[name], dtype=float)
        except (TypeError, ValueError, OverflowError):
            mark = np.array(np.nan)
        size = float(np.abs(own).max(initial=1.0))
        if mark.shape != own.shape or not (np.abs(mark - own) <= SAME * size).all():
            raise UserError(OTHERWISE[name], where=where, key=f"geometry.study.{name}")
