"""Names of joints beside the picture of an arm, each with a line to its joint."""

from typing import Any

import numpy as np

from edtk.model.frames import Frames
from edtk.model.robot import Robot
from edtk.report.plain import plain
from edtk.system.typing import Array

NEAR = 0.03  # joints nearer than this, as parts of the axes, share a label
GAP = 0.06  # between the arm and the column of labels, as a part of the axes
LINE = 0.042  # height of a line of text, likewise
EDGE = 0.02
COLOUR = "#70767d"


def joint_labels(robot: Robot, frames: Frames, ax: Any) -> None:
    """Write the names of joints in columns at both sides of the arm.

    They stand where the joints are seen now: limits and view of the axes come first.

    Args:
        robot: The robot.
        frames: Its pose.
        ax: Axes with a 3D projection.
    """
    groups = _groups(robot, _seen(frames.origins, ax))
    tool = _seen(frames.position[None], ax)
    everything = np.vstack([tool, *(place for _, place in groups)])
    left = everything[:, 0].min()
    right = everything[:, 0].max()
    for column, alignment, is_left in ((left - GAP, "right", True), (right + GAP, "left", False)):
        own = [group for group in groups if (2 * group[1][0] <= left + right) == is_left]
        own.sort(key=lambda group: -group[1][1])
        heights = _heights([place[1] for _, place in own], [len(names) for names, _ in own])
        for (names, place), height in zip(own, heights, strict=True):
            ax.annotate(
                plain("\n".join(names)),
                xy=tuple(place),
                xytext=(float(np.clip(column, EDGE, 1 - EDGE)), height),
                xycoords="axes fraction",
                textcoords="axes fraction",
                ha=alignment,
                va="center",
                fontsize=8,
                bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
                arrowprops={
                    "arrowstyle": "-",
                    "color": COLOUR,
                    "linewidth": 0.6,
                    "shrinkB": 3,
                    "relpos": (1.0 if is_left else 0.0, 0.5),
                },
                annotation_clip=False,
            )


def _seen(points: Array, ax: Any) -> Array:
    """Where points (k, 3) are seen (k, 2), as parts of the axes."""
    from mpl_toolkits.mplot3d import proj3d  # type: ignore[import-untyped]

    x, y, _ = proj3d.proj_transform(*points.T, ax.get_proj())
    to_axes = ax.transData + ax.transAxes.inverted()
    return np.asarray(to_axes.transform(np.column_stack([x, y])))


def _groups(robot: Robot, places: Array) -> list[tuple[list[str], Array]]:
    """Names of joints, and where they are seen (2,); joints at one place are one group."""
    groups: list[tuple[list[str], Array]] = []
    for joint, place in zip(robot.chain, places, strict=True):
        if groups and np.linalg.norm(groups[-1][1] - place) < NEAR:
            groups[-1][0].append(joint.name)
        else:
            groups.append(([joint.name], place))
    return groups


def _heights(wanted: list[float], lines: list[int]) -> list[float]:
    """Heights of labels from top to bottom, near the wanted ones and apart from each other."""
    heights: list[float] = []
    for i, height in enumerate(wanted):
        below = heights[-1] - LINE * (lines[i - 1] + lines[i]) / 2 if heights else np.inf
        heights.append(min(height, below))
    if heights:
        lowest = EDGE + LINE * lines[-1] / 2
        lift = max(0.0, lowest - heights[-1])
        heights = [height + lift for height in heights]
    return heights
