"""Table of a relaxed plan, for a notebook."""

from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.report.notebook_table import notebook_table


def relaxed_plan(plan: RelaxedPlan) -> str:
    """A row for each pose, the heaviest first, and the bounds."""
    table = plan.to_frame()
    rows = [[i + 1, *(f"{value:.6g}" for value in row)] for i, row in enumerate(table.to_numpy())]
    bounds = [plan.proved_bound]
    if plan.searched_bound is not None:
        bounds.append(plan.searched_bound)
    notes = [
        f"bound {bound.value:.6g} ({bound.kind.value}), relative gap {bound.gap:.1e}"
        for bound in bounds
    ]
    return notebook_table(plan.headline(), ["pose", *table.columns], rows, notes)
