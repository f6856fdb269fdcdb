"""Table of a problem, for a notebook."""

from edtk.design.problem import Problem
from edtk.report.notebook_table import notebook_table
from edtk.report.text.problem import problem_rows


def problem(result: Problem) -> str:
    """The rows of the text."""
    return notebook_table(result.headline(), *problem_rows(result))
