"""Picture of a robot."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from edtk.model.frames import Frames
from edtk.model.robot import Robot
from edtk.report.palette import BLUE, GREEN, ORANGE
from edtk.report.plain import plain
from edtk.system.typing import Array

AXIS = 0.12  # length of a joint's axis, over the size of the picture
MARKERS = {"revolute": "o", "prismatic": "s"}
COLOURS = {"revolute": BLUE, "prismatic": GREEN}


def robot(result: Robot, ax: Any = None, q: ArrayLike | None = None) -> Any:
    """Draw the chain in space, with its joint axes.

    Args:
        result: The robot.
        ax: Axes with a 3D projection; a new figure where they are not given.
        q: Joint variables (n,) [rad or m]; defaults to zero, or the limit that is nearest to it.

    Returns:
        The axes.
    """
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.figure(figsize=(6.4, 6.0)).add_subplot(projection="3d")
    variables = np.clip(0.0, *result.limits) if q is None else np.asarray(q, dtype=float)
    frames = result.frames(variables)
    chain = np.vstack([result.base[:3, 3], frames.origins, frames.position])
    size = max(float(np.ptp(chain, axis=0).max()), 1e-3)
    ax.plot(*chain.T, color="black", linewidth=2.5, alpha=0.6)
    _joints(result, frames, AXIS * size, ax)
    ax.plot(*frames.position[:, None], marker="^", color=ORANGE, linestyle="", label="tool point")
    _cube(chain, size, ax)
    ax.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    ax.set_title(plain(result.name), fontsize=10)
    _legend(ax)
    return ax


def _joints(result: Robot, frames: Frames, length: float, ax: Any) -> None:
    """A marker for each joint, on a line along its axis."""
    for joint, origin, axis in zip(result.chain, frames.origins, frames.axes, strict=True):
        line = origin + length * np.outer([-1, 1], axis)
        colour = COLOURS[joint.kind]
        ax.plot(*line.T, color=colour, linewidth=1.2)
        marker = MARKERS[joint.kind]
        ax.plot(*origin[:, None], marker=marker, color=colour, linestyle="", label=joint.kind)
        ax.text(*(origin + length * axis), plain(joint.name), fontsize=8)


def _cube(chain: Array, size: float, ax: Any) -> None:
    """Equal scales along all axes."""
    middle = (chain.min(axis=0) + chain.max(axis=0)) / 2
    half = 0.55 * size
    for limits, centre in zip((ax.set_xlim, ax.set_ylim, ax.set_zlim), middle, strict=True):
        limits(centre - half, centre + half)
    ax.set_box_aspect((1, 1, 1))


def _legend(ax: Any) -> None:
    """Each kind of marker once."""
    handles = dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    ax.legend(handles.values(), handles.keys(), fontsize=8, frameon=False, loc="upper right")
