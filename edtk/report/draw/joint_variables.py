"""Joint variables of a plan, pose by pose."""

from typing import TYPE_CHECKING

from edtk.design.plan import Plan
from edtk.model.robot import Robot
from edtk.report.palette import COLOURS, MARKERS
from edtk.report.plain import plain
from edtk.tables.pose_table import pose_factors

if TYPE_CHECKING:
    from matplotlib.axes import Axes

AREA = 30.0  # of the marker of a single measurement [pt^2]
MOST_TICKS = 30  # poses up to which each one has a tick


def joint_variables(plan: Plan, robot: Robot | None, ax: "Axes") -> None:
    """Draw a marker for each joint and pose, its area in proportion to the repetitions.

    Args:
        plan: Poses and repetitions.
        robot: Names the joints, which are drawn in degrees and millimetres; without it they are
            numbered, and drawn in radians and metres.
        ax: Where to draw.
    """
    k, n = plan.q.shape
    shown = plan.q if robot is None else robot.shown(plan.q) / pose_factors(robot)
    names = [f"q{j + 1}" for j in range(n)] if robot is None else robot.joint_names
    for j, (name, values) in enumerate(zip(names, shown.T, strict=True)):
        colour = COLOURS[j % len(COLOURS)]
        ax.plot(range(1, k + 1), values, color=colour, linewidth=0.8, alpha=0.4)
        marker = MARKERS[j % len(MARKERS)]
        sizes = AREA * plan.repeats
        ax.scatter(range(1, k + 1), values, s=sizes, color=colour, marker=marker, alpha=0.8)
        # An entry of the legend of its own: that of the scatter is as large as its first marker.
        ax.scatter([], [], s=AREA, color=colour, marker=marker, label=plain(name))
    if k <= MOST_TICKS:
        ax.set_xticks(range(1, k + 1))
    repeated = "" if (plan.repeats == 1).all() else " (area of a marker: repetitions)"
    ax.set_xlabel(f"pose{repeated}")
    ax.set_ylabel(_label(robot))
    ax.grid(alpha=0.3)
    ax.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _label(robot: Robot | None) -> str:
    """Name and unit of the joint variables."""
    if robot is None:
        return "joint variable [rad or m]"
    kinds = {joint.kind for joint in robot.joints}
    if kinds == {"revolute"}:
        return "joint angle [deg]"
    return "joint position [mm]" if kinds == {"prismatic"} else "joint variable [deg or mm]"
