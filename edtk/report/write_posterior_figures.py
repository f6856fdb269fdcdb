"""Pictures of a posterior as files."""

from pathlib import Path

from edtk.calibration.posterior_check import PosteriorCheck
from edtk.report.posterior_figures import posterior_figures
from edtk.report.save_figure import save_figure

WRITTEN = ("corner.png", "trace.png", "residuals.png")


def write_posterior_figures(check: PosteriorCheck, folder: Path) -> None:
    """Write corner.png, trace.png and residuals.png."""
    figures = posterior_figures(check)
    save_figure(figures.corner, folder / "corner.png")
    save_figure(figures.trace, folder / "trace.png")
    save_figure(figures.residuals, folder / "residuals.png")
