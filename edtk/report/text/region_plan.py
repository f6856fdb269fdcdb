"""Text of a plan in a region."""

from edtk.design.exact.region_plan import RegionPlan
from edtk.report.text.relaxed_region import region_points
from edtk.report.text_table import text_table


def region_plan(plan: RegionPlan) -> str:
    """Value, bound, and a line for each point with its number of experiments."""
    return "\n".join([plan.headline(), plan_bound(plan), text_table(*plan_rows(plan))])


def plan_bound(plan: RegionPlan) -> str:
    """The bound, what it rests on, and the search."""
    bound = plan.lower_bound
    return (
        f"bound {bound.value:.7g} over the region ({bound.kind.value}); {plan.starts} starts, "
        f"{plan.found} of them as good on the grid, {plan.seconds:.1f} s"
    )


def plan_rows(plan: RegionPlan) -> tuple[list[str], list[list[str]]]:
    """Header and rows: the variables of a point, and its number of experiments."""
    rows = region_points(plan.region, plan.points)
    counts = [str(count) for count in plan.counts]
    header = [*plan.region.variables, "count"]
    return header, [[*row, count] for row, count in zip(rows, counts, strict=True)]
