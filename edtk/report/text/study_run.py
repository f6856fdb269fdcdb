"""Text of a study's run."""

from edtk.report.comparison.cell import percent
from edtk.report.shown_value import shown_value
from edtk.report.text_table import text_table
from edtk.study.study_run import StudyRun


def study_run(run: StudyRun) -> str:
    """A line for each plan."""
    lines = [run.headline(), text_table(*study_run_rows(run))]
    return "\n".join(lines if run.expected is None else [lines[0], str(run.expected), lines[1]])


def study_run_rows(run: StudyRun) -> tuple[list[str], list[list[str]]]:
    """Header and rows: plan, sizes, the main criterion and the efficiency under it."""
    main = run.study.main_criterion
    rows = []
    for _, row in run.table.iterrows():
        cells = [row["reason"], ""]
        if not row["reason"]:
            cells = [shown_value(main, row[main]), percent(row[f"efficiency_{main}"])]
        rows.append([row["plan"], str(row["experiments"]), str(row["poses"]), *cells])
    return ["plan", "experiments", "poses", main, "efficiency"], rows
