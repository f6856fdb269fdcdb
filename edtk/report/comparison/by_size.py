"""The main criterion, size by size."""

from edtk.report.comparison.cell import number, percent
from edtk.report.markdown_table import markdown_table
from edtk.report.other_plans import other_plans
from edtk.report.plans_of import plans_of
from edtk.report.run_unit import run_unit
from edtk.study.study_run import StudyRun


def by_size(run: StudyRun) -> str:
    """A table of our plan, its efficiency, the bound, and plans that were not optimised."""
    main = run.study.main_criterion
    factor, unit = run_unit(run, main)
    others = other_plans(run.table)
    rows = []
    for _, row in plans_of(run.table, "optimised", main).sort_values("experiments").iterrows():
        bound = run.bound(row["experiments"])
        cells = [
            number(factor * row[main]),
            percent(row[f"efficiency_{main}"]),
            "-" if bound is None else number(factor * bound.value),
        ]
        for plans in others.values():
            other = plans[plans["experiments"] == row["experiments"]]
            cells.append(number(factor * other[main].iloc[0]) if len(other) else "-")
        rows.append([row["experiments"], *cells])
    header = ["experiments", f"optimised for {main}", "efficiency", "bound", *others]
    text = f"{main} ({unit}), and the bound over all feasible poses:"
    return f"{text}\n\n{markdown_table(header, rows)}"
