"""Table of a plan on the candidates of a problem, for a notebook."""

from edtk.design.exact.counts.problem_plan import ProblemPlan
from edtk.report.notebook_table import notebook_table
from edtk.report.text.problem_plan import problem_plan_rows


def problem_plan(result: ProblemPlan) -> str:
    """The rows of the text."""
    return notebook_table(result.headline(), *problem_plan_rows(result))
