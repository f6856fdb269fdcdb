"""A robot in space: links as bars, joints as drums with their names, the tool as a frame."""

from itertools import pairwise
from typing import Any

import numpy as np

from edtk.report.figures import BLUE, GREEN, GREY, ORANGE
from edtk.report.shown import plain
from edtk.robots.frames import Frames
from edtk.robots.robot import Robot
from edtk.system.typing import Array

DRUM = (0.028, 0.05)  # radius and half length of a joint, over the size of the picture
SIDES = {"revolute": 24, "prismatic": 4}  # of a drum's outline
TRIAD = ("#c0392b", "#27ae60", "#2c5fb3")  # x, y and z of the tool
TRIAD_LENGTH = 0.1  # over the size
FRONT = 1e3  # order of what is drawn last: before all faces, which matplotlib sorts by depth
BAR = "#8d96a0"
BASE = "#4a4f55"
NEAR_JOINTS = 0.03  # joints nearer than this, as parts of the axes, share a label
GAP = 0.06  # between the arm and the column of labels, as a part of the axes
LINE = 0.042  # height of a line of text, likewise
EDGE_ROOM = 0.02
COLOUR = "#70767d"

COLOURS = {"revolute": BLUE, "prismatic": GREEN}
LIGHT = np.array([0.35, -0.5, 0.8]) / np.linalg.norm([0.35, -0.5, 0.8])


def arm(robot: Robot, frames: Frames, ax: Any) -> None:
    """Draw a robot in one pose on axes with a 3D projection.

    Args:
        robot: The robot.
        frames: The pose.
        ax: The axes.
    """
    points = np.vstack([robot.base[:3, 3], frames.origins, frames.position])
    size = size_of(points)
    _base(robot, frames, size, ax)
    for first, last in pairwise(points):
        if np.linalg.norm(last - first) > 0.02 * size:
            _bar(first, last, 0.013 * size, ax)
    for joint, origin, axis in zip(robot.chain, frames.origins, frames.axes, strict=True):
        tied = joint.name not in robot.joint_names
        colour = GREY if tied else COLOURS[joint.kind]
        _drum(origin, axis, size, SIDES[joint.kind], colour, ax)
        reach = 1.9 * DRUM[1] * size
        line = np.array([origin - reach * axis, origin + reach * axis])
        ax.plot(*line.T, color=colour, linewidth=1.0, linestyle=(0, (5, 2)))
    _tool(frames, size, ax)


def size_of(points: Array) -> float:
    """Size of the picture of points (k, 3) [m]."""
    return max(float(np.ptp(points, axis=0).max()), 1e-3)


def _base(robot: Robot, frames: Frames, size: float, ax: Any) -> None:
    """A foot under the base: a disc in its xy-plane."""
    turn = np.linspace(0, 2 * np.pi, 33)
    disc = 0.09 * size * np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=1)
    _faces([disc @ robot.base[:3, :3].T + robot.base[:3, 3]], BASE, ax, alpha=0.55)


def _bar(first: Array, last: Array, radius: float, ax: Any) -> None:
    """A link: an eight-sided bar."""
    along = (last - first) / np.linalg.norm(last - first)
    _prism(first, last, along, radius, 8, BAR, ax)


def _drum(origin: Array, axis: Array, size: float, sides: int, colour: str, ax: Any) -> None:
    """A joint: a drum along its axis if it turns, a box if it slides."""
    half = DRUM[1] * size * axis
    _prism(origin - half, origin + half, axis, DRUM[0] * size, sides, colour, ax)


def _prism(
    first: Array, last: Array, along: Array, radius: float, sides: int, colour: str, ax: Any
) -> None:
    """The faces of a prism between two points."""
    aside = np.eye(3)[np.argmin(np.abs(along))]
    x = np.cross(along, aside)
    x /= np.linalg.norm(x)
    y = np.cross(along, x)
    turn = np.linspace(0, 2 * np.pi, sides, endpoint=False) + np.pi / 4
    ring = radius * (np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * y)
    low = first + ring
    high = last + ring
    walls = [np.array([low[i], low[i - 1], high[i - 1], high[i]]) for i in range(sides)]
    _faces([*walls, low, high], colour, ax)


def _faces(faces: list[Array], colour: str, ax: Any, alpha: float = 1.0) -> None:
    """Faces, brighter where they look into the light."""
    from matplotlib.colors import to_rgb
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

    shades = []
    for face in faces:
        normal = np.cross(face[1] - face[0], face[2] - face[0])
        length = np.linalg.norm(normal)
        bright = abs(float(normal @ LIGHT)) / length if length else 0.5
        shades.append((*(1 - (1 - np.array(to_rgb(colour))) * (1.05 - 0.45 * bright)), alpha))
    shades = [tuple(np.clip(shade, 0, 1)) for shade in shades]
    ax.add_collection3d(Poly3DCollection(faces, facecolors=shades, edgecolors="none"))


def _tool(frames: Frames, size: float, ax: Any) -> None:
    """The axes of the tool frame, and the tool point."""
    for colour, axis in zip(TRIAD, frames.rotation, strict=True):
        line = np.array([frames.position, frames.position + TRIAD_LENGTH * size * axis])
        ax.plot(*line.T, color=colour, linewidth=2.0)
    point = frames.position[:, None]
    ax.plot(*point, marker="o", markersize=4, color=ORANGE, linestyle="", zorder=FRONT)


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
