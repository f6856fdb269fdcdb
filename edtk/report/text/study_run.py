"""Text of a study's run."""

from edtk.calibration.plan_budget import plan_budget
from edtk.model.error_budget import ErrorBudget
from edtk.report.comparison.cell import percent
from edtk.report.shown_value import shown_value
from edtk.report.text.error_budget import error_budget
from edtk.report.text_table import text_table
from edtk.study.study_run import StudyRun


def study_run(run: StudyRun) -> str:
    """A line for each plan."""
    return "\n".join([run.headline(), *expected_of_run(run), text_table(*study_run_rows(run))])


def expected_of_run(run: StudyRun) -> list[str]:
    """What errors to expect of the largest plan for the main criterion; nothing without a task."""
    if run.expected is None:
        return []
    budget = budget_of_run(run)
    return [*([] if budget is None else [error_budget(budget)]), str(run.expected)]


def budget_of_run(run: StudyRun) -> ErrorBudget | None:
    """The error budget of that plan; None where it is not known, see `plan_budget`."""
    if run.best is None or run.study.specification.parameters is not None:
        return None
    return plan_budget(run.study, run.best)


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
