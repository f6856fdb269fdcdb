"""Table of a plan in a region, for a notebook."""

from edtk.design.exact.region_plan import RegionPlan
from edtk.report.notebook_table import notebook_table
from edtk.report.text.region_plan import plan_bound, plan_rows


def region_plan(result: RegionPlan) -> str:
    """A row for each point, and the bound."""
    return notebook_table(result.headline(), *plan_rows(result), [plan_bound(result)])
