"""Table 6: accuracy of the compensation for repeated plans."""

from pathlib import Path

import numpy as np
import pandas as pd

import criteria
from edtk.design.plan import Plan
from edtk.report.markdown_table import markdown_table
from edtk.study.study import Study
from edtk.system.atomic_file import write_text
from paper_figures import printed_values
from paper_figures.csv_file import write_csv
from paper_figures.example import Array, plans_of_table_4, target_of
from paper_figures.own_plans import own_plans
from paper_figures.targets import both

UNIT = 1e-6
TEXT = """# Table 6: accuracy of the error compensation, rho0

Eq. (20) in 1e-3 mm for every cell that print fills: m experiments in k different configurations, that is the
plan of Table 4 for k experiments carried out m/k times. "Clipped" takes max(A0, 0) for A0, "true" takes A0
itself. The loss is measured against the plan of the same row with k = m. "Own" are plans searched for by this
toolkit in place of those of Table 4, for the clipped and for the true A0, under the same constraints.

## Accuracy [1e-3 mm]

{accuracy}
Largest difference from print: {clipped:.3f} % with the clipped A0, {true:.1f} % with the true A0.

## Loss against the full-dimensional plan

{loss}
## With our own plans in place of Table 4's [1e-3 mm]

{own}
The gain is against the published plan under the same A0.

## What is known and what is not

The numbers agree with print only if the negative entries of A0 are replaced by zero before Eq. (20) is
evaluated, although A0 as recomputed here agrees with the printed Eq. (23), signs included, to {equation:.2f} in
every entry; with A0 as it is, Eq. (20) gives larger values and another order of the plans.
Why the printed numbers correspond to the clipped matrix is not known; edtk itself always uses Eq. (20)
with the true A0, and the clipped variant exists only here and in Fig. 7, to reproduce print.
"""


def compute(study: Study) -> pd.DataFrame:
    """rho0, Eq. (20), for the filled cells of Table 6, with the clipped and with the true A0.

    Returns:
        Columns A0, experiments, configurations, computed and printed rho0 [1e-3 mm], difference_percent,
        loss_percent (computed), printed_loss_percent (text), rho0 of our own plans, and gain_percent of these.
    """
    cells = printed_values.table_6()
    rows = []
    for name, target in both(target_of(study)).items():
        value = _values(study, target, plans_of_table_4(study))
        own = _values(study, target, own_plans(study, name))
        for c in cells:
            m, k = c.experiments, c.configurations
            loss = 100 * (value[m, k] / value[m, m] - 1) if k < m else np.nan
            row = (name, m, k, value[m, k], c.rho0, 100 * (value[m, k] / c.rho0 - 1), loss, c.loss)
            rows.append((*row, own[m, k], 100 * (1 - own[m, k] / value[m, k])))
    columns = ["A0", "experiments", "configurations", "computed_1e-3_mm", "printed_1e-3_mm"]
    columns += [
        "difference_percent",
        "loss_percent",
        "printed_loss_percent",
        "own_1e-3_mm",
        "gain_percent",
    ]
    return pd.DataFrame(rows, columns=columns)


def _values(study: Study, target: Array, plans: dict[int, Plan]) -> dict[tuple[int, int], float]:
    """rho0 [1e-3 mm] of every filled cell: the plan for k experiments carried out m/k times."""
    rho0 = criteria.create("rho0", target)
    return {
        (c.experiments, c.configurations): float(
            rho0.value(
                study.space.information(
                    plans[c.configurations].repeated(c.experiments // c.configurations)
                )
            )
        )
        / UNIT
        for c in printed_values.table_6()
    }


def readable(table: pd.DataFrame, study: Study) -> str:
    """Both variants beside print as Markdown, and what is known about them."""
    clipped, true = (table[table["A0"] == name].to_dict("records") for name in ("clipped", "true"))
    accuracy, loss, own = [], [], []
    for c, t in zip(clipped, true, strict=True):
        cell = f"{c['experiments']} x {c['configurations']}"
        accuracy.append(
            [
                cell,
                f"{c['printed_1e-3_mm']:.3f}",
                *(
                    text
                    for v in (c, t)
                    for text in (f"{v['computed_1e-3_mm']:.3f}", _percent(v["difference_percent"]))
                ),
            ]
        )
        numbers = (f"{v['own_1e-3_mm']:.3f}|{v['gain_percent']:.1f} %" for v in (c, t))
        own.append([cell, *(text for pair in numbers for text in pair.split("|"))])
        if c["printed_loss_percent"]:
            numbers = (f"{v['loss_percent']:.2f} %" for v in (c, t))
            loss.append([cell, f"{c['printed_loss_percent']} %", *numbers])
    largest = table["difference_percent"].abs().groupby(table["A0"]).max()
    return TEXT.format(
        accuracy=markdown_table(
            ["m x k", "printed", "clipped A0", "difference", "true A0", "difference from print"],
            accuracy,
        ),
        own=markdown_table(["m x k", "own, clipped A0", "gain", "own, true A0", "gain"], own),
        loss=markdown_table(["m x k", "printed", "clipped A0", "true A0"], loss),
        clipped=largest["clipped"],
        true=largest["true"],
        equation=np.abs(target_of(study) - printed_values.equation_23()).max(),
    )


def _percent(value: float) -> str:
    """Three decimals where small, one where large."""
    return f"{value:+.3f} %" if abs(value) < 1 else f"{value:+.1f} %"


def write(study: Study, out: Path) -> tuple[Path, ...]:
    """Write table_6.csv and table_6.md."""
    table = compute(study)
    csv, text = out / "table_6.csv", out / "table_6.md"
    write_csv(csv, table)
    write_text(text, readable(table, study))
    return csv, text
