"""Table of a compensation, for a notebook."""

from edtk.calibration.compensation import Compensation
from edtk.report.notebook_table import notebook_table


def compensation(found: Compensation) -> str:
    """A row for each task pose."""
    table = found.to_frame()
    rows = [[i + 1, *(f"{value:.6g}" for value in row)] for i, row in enumerate(table.to_numpy())]
    notes = [found.rigid] if found.rigid else []
    return notebook_table(found.headline(), ["pose", *table.columns], rows, notes)
