"""A figure as a file."""

from pathlib import Path
from typing import TYPE_CHECKING

from edtk.system.atomic_file import atomic_path

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DPI = 150


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a picture atomically, the same bytes for the same figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    with atomic_path(path) as temporary:
        FigureCanvasAgg(figure)
        figure.savefig(temporary, dpi=DPI, metadata={"Software": None})
