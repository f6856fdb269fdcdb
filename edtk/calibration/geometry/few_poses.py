"""Whether the poses of a sheet are enough to judge a fit of geometry by."""

import numpy as np

from edtk.calibration.diagnostics.diagnostic import Severity
from edtk.calibration.geometry.fit_rows import FitRows
from edtk.calibration.geometry.geometric_doubt import GeometricDoubt, rows_in_words
from edtk.inference.geometry.geometric_fit import MM, GeometricFit

ALONE = 1e-9  # leverage below one that rounding makes of a direction that one pose tells
WORSE = 10.0  # times as far off as by the drawing: nothing shows that so few poses tell anything
FEW = 2.5  # coordinates a parameter, below which poses are few


def few_poses(fit: GeometricFit) -> list[GeometricDoubt]:
    """What looks wrong in the number of poses, in any order."""
    return [*_few(fit), *_alone(fit)]


def _few(fit: GeometricFit) -> list[GeometricDoubt]:
    """Hardly more coordinates than parameters."""
    coordinates = fit.data.rows * fit.data.means.count
    if coordinates >= FEW * fit.structural:
        return []
    markers = len(fit.data.markers)
    missing = int(np.ceil((FEW * fit.structural - coordinates) / (fit.data.rows * markers)))
    poses = f"{missing} more pose{'s' if missing > 1 else ''}"
    text = (
        f"{coordinates} coordinates for {fit.structural} parameters leave little to judge by; "
        f"measure {poses}"
    )
    if fit.loo_rms <= WORSE * fit.placed:
        return [GeometricDoubt(Severity.WARNING, "few_poses", text)]
    # Neither residuals nor poses left out speak for such a fit, and an error of one pose is all in.
    text += (
        f". A pose left out is {MM * fit.loo_rms:.3g} mm off, and by the drawing "
        f"{MM * fit.placed:.3g}"
    )
    return [GeometricDoubt(Severity.ALARM, "few_poses", text)]


def _alone(fit: GeometricFit) -> list[GeometricDoubt]:
    """Poses that alone tell something: how far off they are without themselves is not known."""
    if fit.turns is not None:
        return []
    design = FitRows.of(fit).design
    Q = np.linalg.qr(design.reshape(-1, design.shape[-1]))[0].reshape(design.shape)
    leverage = np.linalg.eigvalsh(Q @ np.swapaxes(Q, 1, 2))[:, -1]
    alone = np.flatnonzero(leverage > 1 - ALONE)
    if not len(alone):
        return []
    rows = tuple(sorted({row for pose in alone for row in fit.data.rows_of_pose(int(pose))}))
    text = (
        f"{rows_in_words(rows)}: each tells what no other pose does, so that the error of poses "
        "left out is that of some directions alone, and too small"
    )
    return [GeometricDoubt(Severity.WARNING, "alone", text, rows)]
