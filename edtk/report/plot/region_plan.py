"""Picture of a plan in a region."""

from typing import Any

from edtk.design.exact.region_plan import RegionPlan
from edtk.report.plain import plain
from edtk.report.plot.relaxed_region import over_region


def region_plan(plan: RegionPlan, ax: Any = None) -> Any:
    """Draw the points of a plan over the sensitivity of the relaxation that bounds it.

    Returns:
        The axes.

    Raises:
        UserError: The region has more than two variables.
    """
    ax = over_region(plan.relaxed, plan.points, plan.counts / plan.size, "share", ax)
    ax.set_title(
        f"{plan.size} experiments: {plain(plan.criterion.label)} = {plan.value:.5g}, bound "
        f"{plan.bound:.5g}",
        fontsize=10,
    )
    return ax
