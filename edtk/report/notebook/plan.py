"""Table of a plan, for a notebook."""

from edtk.design.plan import Plan
from edtk.report.notebook_table import notebook_table
from edtk.report.text.plan import plan_rows


def plan(result: Plan) -> str:
    """The rows of the text."""
    return notebook_table(result.headline(), *plan_rows(result))
