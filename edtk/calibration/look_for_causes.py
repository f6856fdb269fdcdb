"""What explains the residuals of a fit."""

from typing import TYPE_CHECKING

from edtk.calibration.causes.find_causes import find_causes
from edtk.calibration.causes.found_causes import FoundCauses
from edtk.calibration.some_rows import some_rows

if TYPE_CHECKING:
    from edtk.calibration.fitted_data import FittedData

MOST_ROWS = 1000  # measurements in which causes are looked for


def look_for_causes(fitted: "FittedData") -> FoundCauses:
    """Look for faults and outliers in the residuals of a fit, or of some of very many rows."""
    if fitted.fit.robust:
        return FoundCauses()  # a robust fit sets aside what a fault makes
    study = fitted.study
    rows = some_rows(len(fitted.data), MOST_ROWS)
    typed = tuple(
        j
        for j, joint in enumerate(study.robot.joints)
        if joint.kind == "revolute" and j not in study.fixed
    )
    measured = fitted.as_linear[rows]
    found = find_causes(
        study.model, fitted.data[rows], measured, typed, study.known, fitted.told_before
    )
    return found.in_rows(rows)
