"""Picture of what a robot is for a calibration: the arm, and where its tool point comes."""

from typing import Any

import numpy as np

from edtk.model.robot_overview import RobotOverview
from edtk.report.palette import BLUE, ORANGE
from edtk.report.plain import plain
from edtk.report.plot.robot import robot

SIZE = (10.0, 5.6)  # [inch]
ARM = "#30343a"


def robot_overview(found: RobotOverview, ax: Any = None) -> Any:
    """Draw the arm at zero, and in two views the points that its tool point reaches.

    Args:
        found: The robot.
        ax: Axes whose place is divided; a new figure where they are not given.

    Returns:
        The axes: the arm, the view from the side, the view from above.

    Raises:
        ValueError: The axes have no place in a grid that could be divided.
    """
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.figure(figsize=SIZE, layout="constrained").subplots()
    place = ax.get_subplotspec()
    if place is None:
        raise ValueError("these axes cannot be divided; expected axes that pyplot.subplots made")
    ax.set_axis_off()
    grid = place.subgridspec(2, 2, width_ratios=[1.7, 1.0])
    figure = ax.get_figure()
    space = robot(found.robot, figure.add_subplot(grid[:, 0], projection="3d"))
    space.set_title(plain(found.headline()), fontsize=10)
    side = figure.add_subplot(grid[0, 1])
    above = figure.add_subplot(grid[1, 1])
    points = found.tool_points
    # The side from which the tool point is seen to move more.
    widest = int(np.ptp(points[:, :2], axis=0).round(6).argmax())
    _view(found, (widest, 2), side)
    _view(found, (0, 1), above)
    side.set(xlabel=f"{'xy'[widest]} [m]", ylabel="z [m]")
    side.set_title("reach from the side and from above")
    side.title.set_fontsize(9)
    above.set(xlabel="x [m]", ylabel="y [m]")
    return np.array([space, side, above])


def _view(found: RobotOverview, axes: tuple[int, int], ax: Any) -> None:
    """Tool points of all poses as two of the world's axes show them, before them the arm."""
    arm = found.robot
    frames = arm.frames(np.clip(0.0, *arm.limits))
    chain = np.vstack([arm.base[:3, 3], frames.origins, frames.position])[:, list(axes)]
    ax.plot(
        *found.tool_points[:, list(axes)].T,
        ".",
        markersize=1.2,
        color=BLUE,
        alpha=0.35,
        rasterized=True,
    )
    ax.plot(*chain.T, color=ARM, linewidth=2.0, marker="o", markersize=3)
    ax.plot(*chain[-1:].T, "o", markersize=4.5, color=ORANGE)
    ax.set_aspect("equal", adjustable="datalim")
    ax.tick_params(labelsize=7)
    ax.grid(alpha=0.25, linewidth=0.5)
