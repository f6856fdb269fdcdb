"""Pictures of a posterior as files."""

from pathlib import Path

from edtk.calibration.posterior_check import PosteriorCheck
from edtk.report.png import png
from edtk.report.posterior_figures import posterior_figures
from edtk.system.atomic_file import Content

NAMES = ("corner.png", "trace.png", "residuals.png")


def posterior_pictures(check: PosteriorCheck, folder: Path) -> dict[Path, Content]:
    """The contents of corner.png, trace.png and residuals.png, by path.

    Args:
        check: The posterior.
        folder: Folder of the pictures.
    """
    figures = posterior_figures(check)
    drawn = (figures.corner, figures.trace, figures.residuals)
    return {folder / name: png(figure) for name, figure in zip(NAMES, drawn, strict=True)}
