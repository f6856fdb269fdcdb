"""The loss of plans for other criteria in the main one."""

import math
from typing import TYPE_CHECKING

from edtk.report.comparison.relative_loss import relative_loss
from edtk.report.markdown_table import markdown_table
from edtk.report.other_plans import other_plans
from edtk.report.plans_of import plans_of
from edtk.study.study_run import StudyRun

if TYPE_CHECKING:
    import pandas as pd


def loss_of_others(run: StudyRun) -> str:
    """How much worse than the plan for the main criterion the other plans are, size by size."""
    main = run.study.main_criterion
    sizes = sorted(run.study.specification.sizes)
    others = [name for name in run.study.specification.optimise if name != main]
    ours = {f"optimised for {name}": plans_of(run.table, "optimised", name) for name in others}
    classical_name = dict(zip(ours, others, strict=True))
    rows = []
    classical = []
    for label, plans in (ours | other_plans(run.table)).items():
        if not plans["experiments"].isin(sizes).any():
            continue
        losses = [_loss(run, plans, size) for size in sizes]
        name = classical_name.get(label)
        rows.append([label, *("-" if math.isnan(x) else f"{100 * x:+.1f} %" for x in losses)])
        if name:
            known = zip(losses, sizes, strict=True)
            classical += [(loss, name, size) for loss, size in known if not math.isnan(loss)]
    if not rows:
        return "There are no other plans.\n"
    text = (
        f"Cost in {main} of each plan, relative to the plan of the same size that was optimised "
        f"for {main}."
    )
    if classical:
        least, cheapest, small = min(classical)
        most, costliest, large = max(classical)
        text += (
            f" A plan that is optimised for another criterion costs between {100 * least:.0f} % "
            f"({cheapest}, {small} experiments) and {100 * most:.0f} % ({costliest}, {large} "
            "experiments)."
        )
    return f"{text}\n\n{markdown_table(['plan', *(f'm = {m}' for m in sizes)], rows)}"


def _loss(run: StudyRun, plans: "pd.DataFrame", size: int) -> float:
    """The loss of a plan in the main criterion; NaN without a plan that identifies everything."""
    main = run.study.main_criterion
    found = plans[plans["experiments"] == size]
    if found.empty:
        return math.nan
    best = plans_of(run.table, "optimised", main, size)[main].iloc[0]
    return float(relative_loss(main, best, found[main].iloc[0]))
