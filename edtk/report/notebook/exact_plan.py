"""Table of an exact plan, for a notebook."""

from edtk.design.exact.exact_plan import ExactPlan
from edtk.report.notebook_table import notebook_table


def exact_plan(found: ExactPlan) -> str:
    """A row for each pose, and the bound."""
    whole = found.whole
    table = whole.to_frame(found.relaxed.space.workspace.robot)
    kept = 0 if found.kept is None else len(found.kept.q)
    rows = [
        [i + 1, "kept" if i < kept else "new", *(f"{value:.6g}" for value in row)]
        for i, row in enumerate(table.to_numpy())
    ]
    kind = found.lower_bound.kind.value
    factor, unit = found.relaxed.criterion.shown
    value, bound = (
        f"{factor * number:.6g} {unit}".strip() for number in (found.value, found.bound)
    )
    notes = [f"value {value}, and no plan of as many is better than {bound} ({kind})"]
    if found.expected is not None:
        notes.append(str(found.expected))
    return notebook_table(found.headline(), ["pose", "", *table.columns], rows, notes)
