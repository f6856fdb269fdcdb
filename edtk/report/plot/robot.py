"""Picture of a robot."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from edtk.model.robot import Robot
from edtk.report.draw.arm import COLOURS, arm
from edtk.report.draw.joint_labels import joint_labels
from edtk.report.palette import GREY, ORANGE
from edtk.report.plain import plain
from edtk.system.typing import Array

MARGIN = 0.12  # around the arm, over its size
VIEW = (22.0, -58.0)  # elevation and azimuth from which it is seen [deg]


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
    arm(result, frames, ax)
    points = np.vstack([result.base[:3, 3], frames.origins, frames.position])
    fit_axes(points, ax)
    ax.view_init(*VIEW)
    ax.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    ax.set_title(plain(result.name), fontsize=10)
    _quiet(ax)
    _legend(result, ax)
    joint_labels(result, frames, ax)
    return ax


def fit_axes(points: Array, ax: Any) -> None:
    """Equal scales along all axes, and no more room than the arm needs."""
    low = points.min(axis=0)
    high = points.max(axis=0)
    size = max(float((high - low).max()), 1e-3)
    # A flat arm needs some depth too.
    thin = np.maximum(0.0, 0.35 * size - (high - low)) / 2
    low = low - thin - MARGIN * size
    high = high + thin + MARGIN * size
    for limits, first, last in zip((ax.set_xlim, ax.set_ylim, ax.set_zlim), low, high, strict=True):
        limits(first, last)
    ax.set_box_aspect(high - low)


def _quiet(ax: Any) -> None:
    """Walls and grid behind the arm, not in front of it."""
    from matplotlib.ticker import MaxNLocator

    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_pane_color((0.97, 0.97, 0.98, 1.0))
        axis.line.set_color("#b0b4b8")
        axis.set_major_locator(MaxNLocator(4))
    ax.tick_params(labelsize=7)


def _legend(result: Robot, ax: Any) -> None:
    """What each colour is."""
    from matplotlib.lines import Line2D

    kinds = {joint.kind for joint in result.joints}
    entries: dict[str, tuple[str, str]] = {
        kind: ("o" if kind == "revolute" else "s", COLOURS[kind]) for kind in sorted(kinds)
    }
    if result.tied:
        entries["follows another joint"] = ("o", GREY)
    entries["tool point"] = ("o", ORANGE)
    handles = [
        Line2D([], [], marker=marker, color=colour, linestyle="", label=label)
        for label, (marker, colour) in entries.items()
    ]
    ax.legend(handles=handles, fontsize=7, frameon=False, loc="upper left")
