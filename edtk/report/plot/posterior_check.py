"""Picture of a posterior check."""

from typing import Any

from edtk.calibration.posterior_check import PosteriorCheck
from edtk.report.draw.corner import corner
from edtk.report.draw.labelled_samples import LabelledSamples
from edtk.report.panels import panels


def posterior_check(check: PosteriorCheck, ax: Any = None) -> Any:
    """Draw each compliance, and each pair of them; lines are at the reference.

    Returns:
        The axes (d, d); those above the diagonal are empty.
    """
    shown = LabelledSamples.of(check)
    d = len(shown.labels)
    axes = panels(ax, d, d, (1.6 + 1.55 * d, 1.6 + 1.55 * d), sharex="col")
    corner(shown, axes)
    if ax is None:
        title = f"Posterior, with contours that hold 39 % and 86 %; lines: {check.reference}"
        axes[0, 0].figure.suptitle(title, fontsize=11)
    return axes
