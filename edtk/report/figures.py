"""Figures for files: their axes, colours and formats."""

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.report.render import render
from edtk.system.errors import ArgumentError
from edtk.system.files import STANDARD_OUTPUT, write_files
from edtk.system.presented import Presented

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe-Ito, safe for colour-blind readers; further lines repeat them with other markers.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#7F7F7F")
MARKERS = "osD^vPX*<>hd"
BLUE = COLOURS[0]
ORANGE = COLOURS[1]
GREEN = COLOURS[2]
GREY = COLOURS[6]
DPI = 150
SIZE = (10.0, 5.6)  # [inch]


def new_figure(width: float, height: float) -> "Figure":
    """An empty figure of that size in inches, whose layout leaves room for labels."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def png(figure: "Figure", dpi: int = DPI) -> bytes:
    """The bytes of a PNG file, the same for the same figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
    return buffer.getvalue()


def panels(
    ax: "Axes | None", rows: int, columns: int, size: tuple[float, float], **options: Any
) -> np.ndarray:
    """Make axes (rows, columns) for a picture.

    Args:
        ax: Axes whose place is divided, or taken as they are for a single panel; a new figure where
            they are not given.
        rows: Number of rows of panels.
        columns: Number of columns of panels.
        size: Width and height of a new figure [inch].
        options: Of `subplots`, such as `sharex`.

    Raises:
        ValueError: The axes have no place in a grid that could be divided.
    """
    if ax is None:
        from matplotlib import pyplot

        figure = pyplot.figure(figsize=size, layout="constrained")
        return np.asarray(figure.subplots(rows, columns, squeeze=False, **options))
    if rows == columns == 1:
        return np.array([[ax]])
    place = ax.get_subplotspec()
    if place is None:
        raise ValueError("these axes cannot be divided; expected axes that pyplot.subplots made")
    ax.set_axis_off()
    grid = place.subgridspec(rows, columns)
    return np.asarray(grid.subplots(squeeze=False, **options))


# Metadata that would make the same picture another file, by its kind.
VARYING: dict[str, dict[str, None]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
SALT: dict[Any, str] = {"svg.hashsalt": "edtk"}


def require_picture(path: Path | str) -> None:
    """Check that a file's ending is that of a picture.

    Raises:
        ArgumentError: It is not.
    """
    if _kind(path) not in VARYING or Path(path) == STANDARD_OUTPUT:
        message = f"expected a file whose name ends in {', '.join('.' + kind for kind in VARYING)}"
        raise ArgumentError(message, argument="plot", given=path)


def picture_file(result: Presented, path: Path | str) -> None:
    """Draw a result and write the picture, the same bytes for the same result.

    Args:
        result: The result, which has a picture.
        path: The file, see `require_picture`.

    Raises:
        OSError: The file cannot be written.
    """
    figure = new_figure(*SIZE)
    render("plot", result, figure.subplots())
    write_files({Path(path): _bytes(figure, _kind(path))})


def _kind(path: Path | str) -> str:
    return Path(path).suffix.removeprefix(".").lower()


def _bytes(figure: "Figure", kind: str) -> bytes:
    import matplotlib

    buffer = io.BytesIO()
    with matplotlib.rc_context(SALT):
        figure.savefig(buffer, format=kind, dpi=DPI, metadata=VARYING[kind])
    return buffer.getvalue()
