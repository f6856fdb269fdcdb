"""Names in a picture: short ones, along axes, and beside the joints of an arm."""

from collections.abc import Sequence
from itertools import takewhile
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.report.shown import plain
from edtk.robots.frames import Frames
from edtk.robots.robot import Robot
from edtk.system.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_SIGNS = 18  # signs of a name
LEAST_SHARED = 4  # signs that all names begin or end with, before these are left out
DOTS = "…"
LEVEL = 7  # signs of a line up to which names stand beside each other
SLOPE = 40  # of longer ones [deg]
LETTER = 0.055  # height of a sign of a sloping name [inch]
NEAR_JOINTS = 0.03  # joints nearer than this, as parts of the axes, share a label
GAP = 0.06  # between the arm and the column of labels, as a part of the axes
LINE = 0.042  # height of a line of text, likewise
EDGE_ROOM = 0.02
COLOUR = "#70767d"


def short_names(names: Sequence[str]) -> list[str]:
    """Shorten names that are too long for a picture; names that differ still do.

    If one is, all lose the words that they begin and end with alike, as names of ROS joints do.
    Then the middle of a name that is still too long is left out.
    """
    if max(map(len, names), default=0) <= MOST_SIGNS:
        return list(names)
    first = _shared(names)
    last = _shared([name[first:][::-1] for name in names])
    before = DOTS if first else ""
    after = DOTS if last else ""
    parts = [f"{before}{name[first : len(name) - last]}{after}" for name in names]
    short = [_without_middle(part) for part in parts]
    return short if len(set(short)) == len(set(names)) else parts


def _shared(names: Sequence[str]) -> int:
    """Number of signs in the words that all names begin with, none of which is left empty."""
    if len(names) < 2:
        return 0
    words = [name.split("_") for name in names]
    alike = takewhile(lambda position: len(set(position)) == 1, zip(*words, strict=False))
    length = sum(len(position[0]) + 1 for position in alike)
    return length if LEAST_SHARED <= length < min(map(len, names)) else 0


def _without_middle(name: str) -> str:
    if len(name) <= MOST_SIGNS:
        return name
    end = (MOST_SIGNS - len(DOTS)) // 2
    return f"{name[: MOST_SIGNS - len(DOTS) - end]}{DOTS}{name[-end:]}"


def room_for(names: Sequence[str]) -> float:
    """Room that sloping names need beside a picture, beyond that of short ones [inch]."""
    return LETTER * max(0, max(map(len, short_names(names)), default=0) - LEVEL)


def name_ticks(ax: "Axes", x: Sequence[str] = (), y: Sequence[str] = (), top: bool = False) -> None:
    """Write names at the whole numbers from zero on, so that none covers another.

    Args:
        ax: Where to draw.
        x: Names along the horizontal axis; they slope where they are long.
        y: Names along the vertical axis.
        top: Whether the horizontal ones are above the picture.
    """
    if x:
        # A second line, such as a unit, is short.
        lines = [name.partition("\n") for name in x]
        first = short_names([line for line, *_ in lines])
        names = [
            f"{plain(name)}{end}{more}" for name, (_, end, more) in zip(first, lines, strict=True)
        ]
        ax.set_xticks(range(len(names)), names)
        if top:
            ax.xaxis.tick_top()
        if max(map(len, first)) > LEVEL:
            side = "left" if top else "right"
            ax.tick_params(axis="x", rotation=SLOPE)
            for label in ax.get_xticklabels():
                label.set(horizontalalignment=side, rotation_mode="anchor")
    if y:
        ax.set_yticks(range(len(y)), list(map(plain, short_names(y))))


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
                xytext=(float(np.clip(column, EDGE_ROOM, 1 - EDGE_ROOM)), height),
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
        if groups and np.linalg.norm(groups[-1][1] - place) < NEAR_JOINTS:
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
        lowest = EDGE_ROOM + LINE * lines[-1] / 2
        lift = max(0.0, lowest - heights[-1])
        heights = [height + lift for height in heights]
    return heights
