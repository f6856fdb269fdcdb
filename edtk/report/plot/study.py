"""Picture of a study."""

from typing import Any

import numpy as np

from edtk.model.task import Task
from edtk.report.palette import BLUE, GREY, ORANGE
from edtk.report.plain import plain
from edtk.report.plot.robot import fit_axes, robot
from edtk.study.study import Study
from edtk.system.typing import Array

MOST_POSES = 12  # drawn of many test poses, evenly spread
ARROW = 0.35  # length of a load's arrow, over the size of the arm


def study(result: Study, ax: Any = None) -> Any:
    """Draw the robot in its test poses, with the load of the task; at zero if it has none.

    The first pose is drawn as bodies, the others as lines between the joints.

    Args:
        result: The study.
        ax: Axes with a 3D projection; a new figure where they are not given.

    Returns:
        The axes.
    """
    tasks = list(result.tasks)
    if not tasks:
        return robot(result.robot, ax)
    first = tasks[0]
    ax = robot(first.model.robot, ax, q=first.q)
    spread = np.linspace(1, len(tasks) - 1, min(len(tasks) - 1, MOST_POSES - 1))
    shown = [tasks[i] for i in np.unique(spread.astype(int))] if len(tasks) > 1 else []
    points = [_chain(task) for task in (first, *shown)]
    for chain in points[1:]:
        ax.plot(*chain.T, color=GREY, linewidth=1.2, marker="o", markersize=2.5)
        ax.plot(*chain[-1:].T, "o", markersize=4, color=ORANGE)
    every = np.vstack(points)
    size = float(np.ptp(every, axis=0).max())
    arrow = _arrow(first, size)
    if arrow is not None:
        ax.quiver(*points[0][-1], *arrow, color=BLUE, linewidth=2.0)
        every = np.vstack([every, points[0][-1] + arrow])
    fit_axes(every, ax)
    several = "" if len(tasks) == 1 else f", {len(tasks)} of them"
    ax.set_title(plain(f"{result.robot.name} in its test pose{several}"), fontsize=10)
    return ax


def _chain(task: Task) -> Array:
    """Base, joints and tool point of a test pose (k, 3) [m]."""
    frames = task.model.robot.frames(task.q)
    return np.vstack([task.model.robot.base[:3, 3], frames.origins, frames.position])


def _arrow(task: Task, size: float) -> Array | None:
    """The direction of the task's force (3,), as long as the picture takes; None without one."""
    force = np.asarray(task.wrench)[:3]
    length = float(np.linalg.norm(force))
    return ARROW * size * force / length if length > 0 else None
