"""A figure as a drawing inside a page."""

import io
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from edtk.report.palette import BLUE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MANY = 500  # points of a line, beyond which dots of a raster take less room than a drawing
DPI = 110  # of such rasters
PX = 96  # of CSS, an inch
# Names of elements come from their content and this salt, so that the same figure is the same text.
SETTINGS: dict[Any, str] = {"svg.fonttype": "none", "svg.hashsalt": "edtk"}
NO_METADATA = dict.fromkeys(("Date", "Creator", "Format", "Type"))


def svg(figure: "Figure") -> tuple[str, float]:
    """Draw a figure as SVG that takes its text colour from the page, on no background.

    Returns:
        The element, and its width [px of CSS].
    """
    import matplotlib
    from matplotlib.lines import Line2D

    for line in figure.findobj(Line2D):
        if np.size(line.get_xdata()) > MANY:
            line.set_rasterized(True)
    buffer = io.StringIO()
    with matplotlib.rc_context(SETTINGS):
        figure.savefig(buffer, format="svg", transparent=True, dpi=DPI, metadata=NO_METADATA)
    text = buffer.getvalue()
    text = text[text.index("<svg") :].replace("#000000", "currentColor")
    # A page has a brighter blue in the dark.
    text = text.replace(BLUE.lower(), "var(--blue)")
    # Inside a page the element needs neither names of dialects nor a version.
    text = re.sub(r' (?:xmlns(?::xlink)?|version)="[^"]*"', "", text)
    return _without_unused_names(text).strip(), PX * figure.get_figwidth()


def _without_unused_names(text: str) -> str:
    """The drawing without names that nothing in it refers to: those of other figures are alike."""
    used = set(re.findall(r'#([^")]+)["\)]', text))
    return re.sub(r' id="([^"]*)"', lambda name: name[0] if name[1] in used else "", text)
