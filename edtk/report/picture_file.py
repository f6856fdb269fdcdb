"""The picture of a result as a file."""

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

from edtk.report.new_figure import new_figure
from edtk.report.png import DPI
from edtk.report.render import render
from edtk.system.atomic_file import STANDARD_OUTPUT, write_files
from edtk.system.errors import ArgumentError
from edtk.system.presented import Presented

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Metadata that would make the same picture another file, by its kind.
VARYING: dict[str, dict[str, None]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
SALT: dict[Any, str] = {"svg.hashsalt": "edtk"}
SIZE = (10.0, 5.6)  # [inch]


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
