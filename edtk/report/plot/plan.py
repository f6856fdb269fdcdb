"""Picture of a plan."""

from typing import Any

from edtk.design.plan import Plan
from edtk.model.robot import Robot
from edtk.report.draw.joint_variables import joint_variables
from edtk.report.panels import panels
from edtk.report.plain import plain


def plan(result: Plan, ax: Any = None, robot: Robot | None = None) -> Any:
    """Draw the joint variables by pose.

    Args:
        result: The plan.
        ax: Where to draw; a new figure where it is not given.
        robot: Gives joints their names and units; without it they are numbered, in rad or m.

    Returns:
        The axes.
    """
    ax = panels(ax, 1, 1, (8.0, 4.2))[0, 0]
    joint_variables(result, robot, ax)
    ax.set_title(plain(result.headline()), fontsize=10)
    return ax
