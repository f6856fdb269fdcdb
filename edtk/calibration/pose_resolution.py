"""How far a measured pose may be from the planned one and still be the same."""

import numpy as np

from edtk.inference.measurements import Measurements
from edtk.study.study import Study
from edtk.system.typing import Array
from edtk.tables.in_file_units import DIGITS
from edtk.tables.pose_table import pose_factors

LEAST = 10.0**-DIGITS  # [deg, mm]: plans have so many digits
ROUNDING = 1e-9  # relative: a pose at the very limit counts as within
SAME_DIGIT = 1e-6  # of a decimal step: below that a number is a multiple of it, but for rounding


def pose_resolution(study: Study, data: Measurements | None = None) -> float:
    """The digits that poses are written with [deg, mm].

    Those are the study's `plan_resolution_deg`, or the digits of the sheet if these are fewer.

    Args:
        study: The study.
        data: The measurements of a sheet, if its digits count.
    """
    steps = [LEAST, study.specification.workspace.plan_resolution_deg]
    if data is not None:
        steps.append(_printed_step(study.robot.shown(data.q) / pose_factors(study.robot)))
    return max(steps) * (1 + ROUNDING)


def _printed_step(values: Array) -> float:
    """The coarsest decimal step of the columns (m, n), as far as they have decimals.

    A column of whole numbers has the digits of the others: it may be a joint that stands still.
    """
    digits = []
    for column in values.T:
        scaled = column * 10.0 ** np.arange(DIGITS + 1)[:, None]
        whole = (np.abs(scaled - np.rint(scaled)) < SAME_DIGIT).all(axis=1)
        digits.append(int(whole.argmax()) if whole.any() else DIGITS)
    return float(10.0 ** -min((d for d in digits if d), default=0))
