"""Picture of an exact plan."""

from typing import Any

from edtk.design.exact.exact_plan import ExactPlan
from edtk.report.draw.joint_variables import joint_variables
from edtk.report.panels import panels
from edtk.report.plain import plain


def exact_plan(found: ExactPlan, ax: Any = None) -> Any:
    """Draw the joint variables by pose, kept experiments first.

    Returns:
        The axes.
    """
    ax = panels(ax, 1, 1, (8.0, 4.2))[0, 0]
    joint_variables(found.whole, found.relaxed.space.workspace.robot, ax)
    if found.kept is not None:
        ax.axvspan(0.5, len(found.kept.q) + 0.5, color="grey", alpha=0.15, linewidth=0)
        ax.set_xlabel(f"{ax.get_xlabel()}; grey: kept")
    ax.set_title(plain(found.headline()), fontsize=10)
    return ax
