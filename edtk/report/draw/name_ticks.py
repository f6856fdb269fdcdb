"""Names along the axes of a picture."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from edtk.report.draw.short_names import short_names
from edtk.report.plain import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEVEL = 7  # signs of a line up to which names stand beside each other
SLOPE = 40  # of longer ones [deg]
LETTER = 0.055  # height of a sign of a sloping name [inch]


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
