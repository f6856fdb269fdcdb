"""Pictures of a sampled posterior."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from edtk.calibration.posterior_check import PosteriorCheck
from edtk.report.draw.corner import corner
from edtk.report.draw.labelled_samples import LabelledSamples
from edtk.report.draw.predictive_residuals import (
    MOST_PANELS,
    PredictiveResiduals,
    predictive_residuals,
)
from edtk.report.draw.trace import trace
from edtk.report.new_figure import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PANEL = 1.55  # side of a panel of the corner [inch]
MARGIN = 1.6  # beside the panels [inch]


@dataclass(frozen=True, eq=False)
class PosteriorFigures:
    """The pictures of one posterior.

    Attributes:
        corner: Each compliance, and each pair of them.
        trace: The chain after burn-in.
        residuals: Residuals, and where new measurements would fall.
    """

    corner: "Figure"
    trace: "Figure"
    residuals: "Figure"


def posterior_figures(check: PosteriorCheck) -> PosteriorFigures:
    """Draw a posterior."""
    shown = LabelledSamples.of(check)
    return PosteriorFigures(_corner(check, shown), _trace(check, shown), _residuals(check))


def _corner(check: PosteriorCheck, shown: LabelledSamples) -> "Figure":
    """Histograms and pairwise clouds."""
    d = len(shown.labels)
    figure = new_figure(MARGIN + PANEL * d, MARGIN + PANEL * d)
    figure.set_layout_engine("constrained", hspace=0.02, wspace=0.02)
    corner(shown, figure.subplots(d, d, sharex="col", squeeze=False))
    title = f"Posterior, with contours that hold 39 % and 86 %; lines: {check.reference}"
    figure.suptitle(title, fontsize=11)
    return figure


def _trace(check: PosteriorCheck, shown: LabelledSamples) -> "Figure":
    """Walkers by step."""
    d = len(shown.labels)
    figure = new_figure(9.0, 0.8 + 1.3 * d)
    trace(shown, check.posterior.steps, figure.subplots(d, 1, sharex=True, squeeze=False)[:, 0])
    title = f"Walkers (blue), their mean (black) and {check.reference} (orange)"
    figure.suptitle(title, fontsize=11)
    return figure


def _residuals(check: PosteriorCheck) -> "Figure":
    """Residuals in bands."""
    found = PredictiveResiduals.of(check)
    rows = found.residual.shape[1]
    panels = min(rows, MOST_PANELS)
    figure = new_figure(9.0, 1.0 + 1.7 * panels)
    predictive_residuals(found, figure.subplots(panels, 1, sharex=True, squeeze=False)[:, 0])
    some = f" (first {panels} of {rows} coordinates)" if panels < rows else ""
    title = f"Residuals{some}, and where 95 % of new measurements would fall"
    figure.suptitle(f"{title}: {100 * found.inside:.0f} % are inside", fontsize=11)
    return figure
