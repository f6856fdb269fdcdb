"""The rows of a sheet that have been measured."""

import numpy as np

from edtk.system.note import note
from edtk.tables.pose_table import PoseTable
from edtk.tables.sheet_columns import FINISHED_BY


def finished_rows(table: PoseTable) -> PoseTable:
    """Leave out the rows of a sheet that are not filled in yet, with a note that says how many.

    Raises:
        PoseFileError: No row is filled in.
    """
    done = table.filled(FINISHED_BY)
    if done.all():
        return table
    columns = [column for column in FINISHED_BY if column in table]
    if not done.any():
        raise table.error(f"no row is filled in; expected measurements in {', '.join(columns)}")
    count = int(done.sum())
    gaps = not done[: np.flatnonzero(done)[-1]].all()
    counted = "; rows are counted without them" if gaps else ""
    note(f"{count} of {len(table)} rows are filled in, the others left out{counted}", table.path)
    return table.of_some(done)
