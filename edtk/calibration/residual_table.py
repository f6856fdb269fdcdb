"""The residuals of a calibration as a table."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.calibration.fitted_data import FittedData
from edtk.tables.coordinate_columns import coordinate_columns

if TYPE_CHECKING:
    import pandas as pd


def residual_table(fitted: FittedData) -> "pd.DataFrame":
    """A row for each measured coordinate.

    `row` and `pose` count from 1; `coordinate` has the unit of `residual` in its name.
    """
    import pandas as pd

    fit = fitted.fit
    m, rows = fit.residual.shape
    units = np.where(np.arange(rows) < 3, 1e3, 180 / np.pi)
    return pd.DataFrame(
        {
            "row": np.repeat(np.arange(1, m + 1), rows),
            "pose": np.repeat(fitted.data.pose + 1, rows),
            "coordinate": np.tile(coordinate_columns(rows), m),
            "residual": (fit.residual * units).ravel(),
            "leverage": fit.leverage.ravel(),
            "standardised": fit.standardised.ravel(),
        }
    )
