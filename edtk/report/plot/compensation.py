"""Picture of a compensation."""

from typing import Any

import numpy as np

from edtk.calibration.compensation import Compensation
from edtk.report.palette import BLUE, ORANGE
from edtk.report.panels import panels
from edtk.report.plain import plain
from edtk.system.typing import Array

MOST_BARS = 20  # poses up to which each has bars of its own
SHIFT = 0.2  # of the two bars of a pose, which are twice as wide


def compensation(found: Compensation, ax: Any = None) -> Any:
    """Draw the error before and after compensation by pose, the latter with its 95 % band.

    Returns:
        The axes.
    """
    ax = panels(ax, 1, 1, (6.8, 3.8))[0, 0]
    pose: Array = found.rows.astype(float) + 1
    if len(pose) <= MOST_BARS:
        _bars(found, pose, ax)
    else:
        _lines(found, pose, ax)
    ax.set_yscale("log")
    ax.set_xlabel("task pose")
    ax.set_ylabel("error of the tool point [mm]")
    ax.set_title(plain(found.headline()), fontsize=10)
    ax.grid(axis="y", alpha=0.3)
    ax.set_axisbelow(True)
    ax.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return ax


def _bars(found: Compensation, pose: Array, ax: Any) -> None:
    """Two bars for each of a few poses."""
    before = 1e3 * found.uncompensated
    ax.bar(pose - SHIFT, before, 2 * SHIFT, color=ORANGE, label="before")
    if found.remaining is not None and found.band is not None:
        after = 1e3 * found.remaining
        ends = 1e3 * found.band.T
        ax.bar(pose + SHIFT, after, 2 * SHIFT, color=BLUE, label="after, root mean square")
        # The root mean square may lie outside a narrow band by rounding.
        reach = np.maximum(np.abs(ends - after), 0.0)
        middle = pose + SHIFT
        ax.errorbar(middle, after, reach, fmt="none", color="black", capsize=4, label="95 % band")
    ax.set_xticks(pose)


def _lines(found: Compensation, pose: Array, ax: Any) -> None:
    """Lines over many poses, which are those of a path."""
    ax.plot(pose, 1e3 * found.uncompensated, color=ORANGE, label="before")
    if found.remaining is not None and found.band is not None:
        low, high = 1e3 * found.band.T
        ax.fill_between(pose, low, high, color=BLUE, alpha=0.18, linewidth=0, label="95 % band")
        ax.plot(pose, 1e3 * found.remaining, color=BLUE, label="after, root mean square")
    ax.set_xlim(pose[0], pose[-1])
