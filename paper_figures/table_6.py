"""Table 6: accuracy of the compensation for repeated plans."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from edtk import Plan, Study, criteria
from edtk.report.tables import markdown_table
from edtk.system.files import write_text
from edtk.system.typing import Array
from paper_figures import printed_values
from paper_figures.csv_file import write_csv
from paper_figures.example import plans_of_table_4, target_of
from paper_figures.fill_page import fill_page
from paper_figures.own_plans import own_plans
from paper_figures.targets import both

UNIT = 1e-6  # 1e-3 mm
COLUMNS = [
    "A0",
    "experiments",
    "configurations",
    "computed_1e-3_mm",
    "printed_1e-3_mm",
    "difference_percent",
    "loss_percent",
    "printed_loss_percent",
    "own_1e-3_mm",
    "gain_percent",
]
ACCURACY = ("m x k", "printed", "clipped A0", "difference", "true A0", "difference from print")
LOSS = ("m x k", "printed", "clipped A0", "true A0")
OWN = ("m x k", "own, clipped A0", "gain", "own, true A0", "gain")

Row = dict[Any, Any]


def compute(study: Study) -> pd.DataFrame:
    """rho0, Eq. (20), for the filled cells of Table 6, with the clipped and with the true A0.

    Returns:
        Columns A0, experiments, configurations, computed and printed rho0 [1e-3 mm],
        difference_percent, loss_percent (computed), printed_loss_percent (text), rho0 of our own
        plans, and gain_percent of these.
    """
    cells = printed_values.table_6()
    rows = []
    for name, target in both(target_of(study)).items():
        value = _values(study, target, plans_of_table_4(study))
        own = _values(study, target, own_plans(study, name))
        for c in cells:
            m = c.experiments
            k = c.configurations
            rho0 = value[m, k]
            difference = 100 * (rho0 / c.rho0 - 1)
            # The last cell of a row is what the others are measured against.
            loss = 100 * (rho0 / value[m, m] - 1) if k < m else np.nan
            gain = 100 * (1 - own[m, k] / rho0)
            rows.append((name, m, k, rho0, c.rho0, difference, loss, c.loss, own[m, k], gain))
    return pd.DataFrame(rows, columns=COLUMNS)


def _values(study: Study, target: Array, plans: dict[int, Plan]) -> dict[tuple[int, int], float]:
    """rho0 [1e-3 mm] of every filled cell: the plan for k experiments carried out m/k times."""
    rho0 = criteria.create("rho0", target)
    values = {}
    for c in printed_values.table_6():
        plan = plans[c.configurations].repeated(c.experiments // c.configurations)
        value = float(rho0.value(study.space.information(plan)))
        values[c.experiments, c.configurations] = value / UNIT
    return values


def readable(table: pd.DataFrame, study: Study) -> str:
    """Both variants beside print as Markdown, and what is known about them."""
    clipped = table[table["A0"] == "clipped"].to_dict("records")
    true = table[table["A0"] == "true"].to_dict("records")
    pairs = list(zip(clipped, true, strict=True))
    largest = table["difference_percent"].abs().groupby(table["A0"]).max()
    return fill_page(
        "table_6",
        accuracy=markdown_table(ACCURACY, [_accuracy(*pair) for pair in pairs]),
        own=markdown_table(OWN, [_own(*pair) for pair in pairs]),
        loss=markdown_table(LOSS, [_loss(*p) for p in pairs if p[0]["printed_loss_percent"]]),
        clipped=largest["clipped"],
        true=largest["true"],
        equation=np.abs(target_of(study) - printed_values.equation_23()).max(),
    )


def _cell(row: Row) -> str:
    """Experiments and configurations, as the table names a cell."""
    return f"{row['experiments']} x {row['configurations']}"


def _accuracy(clipped: Row, true: Row) -> list[str]:
    """Printed accuracy, and both computed ones with their differences from it."""
    texts = [_cell(clipped), f"{clipped['printed_1e-3_mm']:.3f}"]
    for row in (clipped, true):
        texts += [f"{row['computed_1e-3_mm']:.3f}", _percent(row["difference_percent"])]
    return texts


def _own(clipped: Row, true: Row) -> list[str]:
    """Accuracy and gain of our own plans."""
    texts = [_cell(clipped)]
    for row in (clipped, true):
        texts += [f"{row['own_1e-3_mm']:.3f}", f"{row['gain_percent']:.1f} %"]
    return texts


def _loss(clipped: Row, true: Row) -> list[str]:
    """Printed loss, and both computed ones."""
    computed = [f"{row['loss_percent']:.2f} %" for row in (clipped, true)]
    return [_cell(clipped), f"{clipped['printed_loss_percent']} %", *computed]


def _percent(value: float) -> str:
    """Three decimals where small, one where large."""
    return f"{value:+.3f} %" if abs(value) < 1 else f"{value:+.1f} %"


def write(study: Study, out: Path) -> tuple[Path, ...]:
    """Write table_6.csv and table_6.md."""
    table = compute(study)
    csv = out / "table_6.csv"
    text = out / "table_6.md"
    write_csv(csv, table)
    write_text(text, readable(table, study))
    return csv, text
