"""Table of a posterior check, for a notebook."""

from edtk.calibration.posterior_check import PosteriorCheck
from edtk.report.digits import digits
from edtk.report.notebook_table import notebook_table


def posterior_check(check: PosteriorCheck) -> str:
    """A row for each compliance, and the test pose."""
    column, label = check.compared
    rows = []
    for row in check.table.to_dict(orient="records"):
        std = row["std_posterior"]
        mean = digits(row["mean"], std)
        ratio = f"{row['ratio']:.3f} \u00b1 {row['ratio_error']:.3f}"
        cells = [row["parameter"], mean, f"{std:.2e}", f"{row[column]:.2e}", ratio, row["unit"]]
        rows.append(cells)
    notes = [] if check.pose is None else [check.pose.headline()]
    header = ["parameter", "mean", "std", label, "ratio", "unit"]
    return notebook_table(check.headline(), header, rows, notes)
