"""Table 5: standard deviations of the estimated compliances."""

from pathlib import Path

import numpy as np
import pandas as pd

from edtk import Study
from edtk.fit.least_squares import covariance
from edtk.report.tables import markdown_table
from edtk.system.files import write_text
from paper_figures import printed_values
from paper_figures.csv_file import write_csv
from paper_figures.example import plans_of_table_4
from paper_figures.fill_page import fill_page

UNIT = 1e-9  # of the printed deviations [rad/(N m)]


def compute(study: Study) -> pd.DataFrame:
    """``sqrt(diag(cov(k)))``, Eq. (13), a row per cell of Table 5, beside print.

    Returns:
        Columns experiments, parameter, computed and printed [1e-9 rad/(N m)], difference_percent.
    """
    printed = printed_values.table_5()
    rows = []
    for m, plan in plans_of_table_4(study).items():
        cov = covariance(study.space.information(plan), study.model.parameters)
        for name, value in zip(study.model.parameters, np.sqrt(np.diag(cov)) / UNIT, strict=True):
            rows.append((m, name, float(value), float(printed[name].loc[m])))
    columns = ["experiments", "parameter", "computed_1e-9", "printed_1e-9"]
    table = pd.DataFrame(rows, columns=columns)
    table["difference_percent"] = 100 * (table["computed_1e-9"] / table["printed_1e-9"] - 1)
    return table


def readable(table: pd.DataFrame) -> str:
    """The table as Markdown: computed, printed and difference for each plan."""
    parameters = list(dict.fromkeys(table["parameter"]))
    header = ["plan", "", *(f"d{p}" for p in parameters)]
    rows: list[list[str]] = []
    for m, group in table.groupby("experiments"):
        rows.append([f"{m} exp.", "computed", *(f"{v:.4g}" for v in group["computed_1e-9"])])
        rows.append(["", "printed", *(f"{v:.3g}" for v in group["printed_1e-9"])])
        rows.append(["", "difference", *(f"{v:+.2f} %" for v in group["difference_percent"])])
    largest = float(table["difference_percent"].abs().max())
    return fill_page("table_5", table=markdown_table(header, rows), largest=largest)


def write(study: Study, out: Path) -> tuple[Path, ...]:
    """Write table_5.csv and table_5.md."""
    table = compute(study)
    csv = out / "table_5.csv"
    text = out / "table_5.md"
    write_csv(csv, table)
    write_text(text, readable(table))
    return csv, text
