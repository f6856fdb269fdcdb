"""The residuals of a calibration as a table."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.calibration.fitted_data import FittedData
from edtk.tables.coordinate_columns import coordinate_columns
from edtk.tables.sheet_columns import TURN_COLUMN

if TYPE_CHECKING:
    import pandas as pd


def residual_table(fitted: FittedData) -> "pd.DataFrame":
    """A row for each measured coordinate.

    `row` and `pose` count from 1; `coordinate` has the unit of `residual` in its name.
    """
    import pandas as pd

    fit = fitted.fit
    m, rows = fit.residual.shape
    units = np.where(fitted.data.lengths, 1e3, 180 / np.pi)
    columns = np.tile(coordinate_columns(rows), (m, 1)).astype(object)
    if fitted.data.turn is not None:
        columns[fitted.data.turn] = TURN_COLUMN
    return pd.DataFrame(
        {
            "row": np.repeat(np.arange(1, m + 1), rows),
            "pose": np.repeat(fitted.data.pose + 1, rows),
            "coordinate": columns.ravel(),
            "residual": (fit.residual * units).ravel(),
            "leverage": fit.leverage.ravel(),
            "standardised": fit.standardised.ravel(),
        }
    )
