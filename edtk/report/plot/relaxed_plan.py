"""Picture of a relaxed plan."""

from typing import Any

from edtk.design.relaxation.relaxed_plan import RelaxedPlan
from edtk.report.draw.weight_bars import weight_bars
from edtk.report.panels import panels
from edtk.report.plain import plain
from edtk.report.shown_value import shown_value


def relaxed_plan(plan: RelaxedPlan, ax: Any = None) -> Any:
    """Draw the weights by pose, with value and bound in the title.

    Returns:
        The axes.
    """
    ax = panels(ax, 1, 1, (7.0, 3.6))[0, 0]
    names = [str(i + 1) for i in (-plan.weights).argsort(kind="stable").argsort(kind="stable")]
    weight_bars(plan.weights, names, "pose", ax)
    name = plan.criterion.label
    bound = plan.best_bound
    ax.set_title(
        f"{plain(name)} = {shown_value(name, plan.value, 5)} per experiment, "
        f"bound {shown_value(name, bound.value, 5)} ({bound.kind.value})",
        fontsize=10,
    )
    return ax
