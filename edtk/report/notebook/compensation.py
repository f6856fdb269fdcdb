"""Table of a compensation, for a notebook."""

from edtk.calibration.compensation import Compensation
from edtk.calibration.refused_rows import refused_in_words
from edtk.report.notebook_table import notebook_table
from edtk.tables.sheet_columns import ROW_COLUMN


def compensation(found: Compensation) -> str:
    """A row for each task pose."""
    table = found.to_frame().drop(columns=ROW_COLUMN, errors="ignore")
    values = zip(found.rows, table.to_numpy(), strict=True)
    rows = [[row + 1, *(f"{value:.6g}" for value in one)] for row, one in values]
    notes = [*filter(None, (found.rigid, refused_in_words(found.refused)))]
    return notebook_table(found.headline(), ["pose", *table.columns], rows, notes)
