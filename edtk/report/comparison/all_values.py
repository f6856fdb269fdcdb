"""All plans under all criteria."""

from edtk.report.comparison.cell import number
from edtk.report.markdown_table import markdown_table
from edtk.report.shown_unit import shown_unit
from edtk.study.study_run import StudyRun


def all_values(run: StudyRun) -> str:
    """A table of plans (rows) and criteria (columns); a plan that does not exist has its reason."""
    names = list(run.study.specification.criteria)
    rows = []
    for _, row in run.table.sort_values("experiments", kind="stable").iterrows():
        cells = [number(shown_unit(name)[0] * row[name]) for name in names]
        if row["reason"]:
            cells = [row["reason"], *[""] * (len(names) - 1)]
        rows.append([row["plan"], *cells])
    header = [
        "plan",
        *(f"{each.label} ({each.sense})" for each in map(run.designs.criterion, names)),
    ]
    return markdown_table(header, rows)
