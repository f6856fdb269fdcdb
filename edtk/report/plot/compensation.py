"""Picture of a compensation."""

from typing import Any

import numpy as np

from edtk.calibration.compensate import Compensation
from edtk.report.palette import BLUE, ORANGE
from edtk.report.panels import panels
from edtk.report.plain import plain

SHIFT = 0.2  # of the two bars of a pose, which are twice as wide


def compensation(found: Compensation, ax: Any = None) -> Any:
    """Draw the error before and after compensation by pose, the latter with its 95 % band.

    Returns:
        The axes.
    """
    ax = panels(ax, 1, 1, (6.8, 3.8))[0, 0]
    pose = np.arange(1, len(found.command) + 1)
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
    ax.set_yscale("log")
    ax.set_xticks(pose)
    ax.set_xlabel("task pose")
    ax.set_ylabel("error of the tool point [mm]")
    ax.set_title(plain(found.headline()), fontsize=10)
    ax.grid(axis="y", alpha=0.3)
    ax.set_axisbelow(True)
    ax.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return ax
