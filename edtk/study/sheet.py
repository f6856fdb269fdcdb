"""The sheet on which a plan's measurements are written down."""

import numpy as np
import pandas as pd

from edtk.design import Plan
from edtk.inference.measurements import DEFLECTION_COLUMNS, LOADED_COLUMNS, ROTATION_COLUMNS, UNLOADED_COLUMNS
from edtk.inference.visiting_order import visiting_order
from edtk.study.study import Study


def sheet(study: Study, plan: Plan, positions: bool = False) -> pd.DataFrame:
    """A row per repetition, poses in an order of little joint travel, repetitions of a pose one after another.

    Args:
        study: Says what is measured.
        plan: What is to be measured.
        positions: Empty columns for the unloaded and the loaded position instead of the displacement.

    Returns:
        Poses and wrenches in the units of the headers, and empty columns to fill in: a measurement file to be.
    """
    lower, upper = study.robot.limits
    table = plan.table(study.robot).iloc[visiting_order(plan.q, upper - lower)]
    table = table.loc[table.index.repeat(table["repeats"])].drop(columns="repeats").reset_index(drop=True)
    empty: tuple[str, ...] = (*UNLOADED_COLUMNS, *LOADED_COLUMNS) if positions else DEFLECTION_COLUMNS
    if study.file.measurement.rows == "pose":
        empty += ROTATION_COLUMNS
    table[list(empty)] = np.nan
    return table
