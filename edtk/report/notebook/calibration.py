"""Table of a calibration, for a notebook."""

from edtk.calibration.calibration import Calibration
from edtk.report.digits import digits
from edtk.report.notebook_table import notebook_table


def calibration(found: Calibration) -> str:
    """A row for each compliance, and the diagnostics."""
    rows = []
    for row in found.to_frame().to_dict(orient="records"):
        std = row["std"]
        interval = f"{digits(row['low_95'], std)} .. {digits(row['high_95'], std)}"
        cells = [row["joint"], row["parameter"], digits(row["k"], std), f"{std:.1e}"]
        rows.append([*cells, interval, row["unit"]])
    header = ["joint", "parameter", "compliance", "std", "95 % interval", "unit"]
    notes = [f"{seen.severity.name.lower()}: {seen.text}" for seen in found.diagnostics]
    return notebook_table(found.headline(), header, rows, notes)
