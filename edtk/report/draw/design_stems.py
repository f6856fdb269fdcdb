"""The points of a design under the curve of its sensitivity."""

from typing import TYPE_CHECKING

from edtk.report.palette import BLUE, ORANGE
from edtk.system.typing import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def design_stems(at: Array, shares: Array, share: str, variable: str, ax: "Axes") -> None:
    """Draw a stem of its share at each point, and the line that no sensitivity exceeds.

    The curve of the sensitivity, in parts of the largest, is drawn already.

    Args:
        at: Places (k,) of the points.
        shares: Their shares (k,) of the experiments.
        share: What a share is called.
        variable: Name of the axis of places.
        ax: Where to draw.
    """
    ax.axhline(1.0, color=BLUE, linewidth=0.8, linestyle=":")
    ax.vlines(at, 0, shares, color=ORANGE, linewidth=2)
    ax.plot(at, shares, "o", color=ORANGE, label=share, clip_on=False)
    ax.set_xlabel(variable)
    ax.set_ylabel(f"{share}, sensitivity / largest [-]")
    # Beside the picture: there is no place inside that no design uses.
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    ax.grid(axis="y", alpha=0.3)
    ax.set_axisbelow(True)
