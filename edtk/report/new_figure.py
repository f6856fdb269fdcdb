"""An empty figure for a file, which no window shows."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def new_figure(width: float, height: float) -> "Figure":
    """An empty figure of that size in inches, whose layout leaves room for labels."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")
