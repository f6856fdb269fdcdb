"""The main criterion for experiments in fewer distinct poses."""

from typing import TYPE_CHECKING

import criteria
from edtk.report.comparison.cell import number
from edtk.report.comparison.relative_loss import relative_loss
from edtk.report.markdown_table import markdown_table
from edtk.report.plans_of import plans_of
from edtk.report.run_unit import run_unit
from edtk.study.study_run import StudyRun

if TYPE_CHECKING:
    import pandas as pd

WORTH = 0.01  # relative loss that fewer distinct poses are worth


def fewer_poses(run: StudyRun) -> str:
    """A table of the loss by the number of distinct poses, and the number that suffices."""
    main = run.study.main_criterion
    factor, unit = run_unit(run, main)
    some = run.table[(run.table["kind"] == "distinct") & run.table[main].notna()]
    if some.empty:
        return "No size allows fewer distinct poses.\n"
    numbers = sorted(some["distinct_at_most"].unique())
    rows = []
    advice = []
    for m in sorted(some["experiments"].unique()):
        values = _values(run, some[some["experiments"] == m], m)
        losses = relative_loss(main, values.iloc[-1], values)
        enough = int(losses.index[losses < WORTH][0])
        advice.append(f"{enough} for m = {m}")
        cells = [
            f"{number(factor * values[k])} ({100 * losses[k]:+.2f} %)" if k in values else ""
            for k in numbers
        ]
        rows.append([m, *cells, number(factor * values.iloc[-1]), enough])
    text = (
        f"{main} ({unit}) of m experiments in at most k distinct poses, each measured as often as "
        "is best, and the loss against any number of poses. "
        f"Enough for a loss below {100 * WORTH:.0f} %: {', '.join(advice)}.\n"
    )
    header = ["experiments", *(f"k = {k}" for k in numbers), "any", "recommended k"]
    return f"{text}\n{markdown_table(header, rows)}"


def _values(run: StudyRun, some: "pd.DataFrame", m: int) -> "pd.Series":
    """The main criterion of m experiments by the number of distinct poses, any number last.

    A plan of fewer poses is one of at most more poses, too: it counts where it is better.
    """
    import pandas as pd

    main = run.study.main_criterion
    plans = pd.concat([some, plans_of(run.table, "optimised", main, m)])
    values = plans.set_index("distinct_at_most")[main].sort_index()
    return values.cummin() if criteria.get(main).sense == "min" else values.cummax()
