"""Picture of a calibration."""

from typing import Any

from edtk.calibration.calibration import Calibration
from edtk.report.draw.intervals import intervals
from edtk.report.draw.residuals import ResidualPanel, residuals
from edtk.report.panels import panels


def calibration(found: Calibration, ax: Any = None) -> Any:
    """Draw 95 % intervals of the compliances, and the residuals below them.

    Returns:
        The axes: intervals, residuals of positions [mm] and, where measured, of rotations [deg].
    """
    fit = found.fit
    parts = ResidualPanel.of(fit, found.data.turn)
    axes = panels(ax, 1 + len(parts), 1, (6.4, 2.6 + 2.8 * len(parts)))[:, 0]
    intervals(fit, found.parameters, found.study.model.units, axes[0])
    residuals(fit, axes[1:], parts)
    axes[0].set_title(_title(found), fontsize=10)
    return axes


def _title(found: Calibration) -> str:
    """The accuracy to expect, and the verdict."""
    if found.study.target is None:
        return f"verdict: {found.verdict}"
    rho0 = 1e3 * found.fit.accuracy(found.study.target)[0]
    return f"rho0 = {rho0:.4g} mm, verdict: {found.verdict}"
