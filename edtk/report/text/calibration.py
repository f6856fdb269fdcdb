"""Text of a calibration."""

import numpy as np

from edtk.calibration.calibration import VERDICTS, Calibration
from edtk.calibration.diagnostics.diagnostic import Severity
from edtk.calibration.row_names import row_names
from edtk.inference.estimate_noise import NoiseEstimate
from edtk.report.digits import digits
from edtk.report.shown_probability import shown_probability
from edtk.report.text.error_budget import error_budget
from edtk.report.text_table import name_width
from edtk.tables.coordinate_columns import coordinate_columns
from edtk.tables.sheet_columns import TURN_COLUMN


def calibration(found: Calibration) -> str:
    """Compliances, how well they fit, the accuracy to expect, and the verdict."""
    lines = [*_compliances(found), *_fit(found), *_accuracy(found), *_rows(found)]
    if found.check is not None:
        lines += ["posterior", found.check.summary()]
    for diagnostic in found.diagnostics:
        if diagnostic.severity is Severity.NOTE:
            lines.append(f"note: {diagnostic.text}")
    return "\n".join([*lines, f"verdict: {found.verdict}"])


def _compliances(found: Calibration) -> list[str]:
    """Estimates with standard deviations, and their correlation."""
    fit = found.fit
    names = found.parameters
    m, rows = fit.residual.shape
    poses = found.data.pose.max() + 1
    width = name_width(names, 6)
    loss = ", Huber's loss" if fit.robust and not found.fitted.untold else ""
    loss += ", loaded equilibrium" if found.fitted.nonlinear else ", linear model"
    lines = [f"{m} measurements of {poses} poses, {m * rows} coordinates{loss}"]
    for name, k, std, unit in zip(names, fit.k, fit.std, found.study.model.units, strict=True):
        lines.append(f"  {name:{width}}{digits(k, std):>12} +- {std:.1e} {unit}")
    if found.part is not None:
        rigid = ", ".join(found.part.rigid)
        lines.append(f"  not told by the measurements, and taken as rigid: {rigid}")
    if found.assumed:
        lines.append(f"  {found.assumed}")
    if found.interest:
        lines.append("of interest")
        unit = found.asked.model.unit
        wide = name_width(tuple(found.interest), 6)
        for name, (value, std) in found.interest.items():
            lines.append(f"  {name:{wide}}{digits(value, std):>12} +- {std:.1e} {unit}")
    lines.append("correlation")
    for name, row in zip(names, fit.correlation, strict=True):
        lines.append(f"  {name:{width}}" + "".join(f"{c:8.3f}" for c in row))
    return lines


def _fit(found: Calibration) -> list[str]:
    """Chi-square and the noise."""
    fit = found.fit
    p = (
        ""
        if fit.p_value is None
        else f", probability of more {shown_probability(fit.p_value, 3).removeprefix('= ')}"
    )
    lines = [f"chi-square {fit.chi2:.5g} with {fit.dof} degrees of freedom{p}"]
    if np.isfinite(fit.scale):
        lines.append(f"sigma from the residuals {1e3 * found.sigma_hat:.4g} mm")
    if found.noise is not None:
        lines.append(_parts_of_noise(found.noise))
    return lines


def _parts_of_noise(noise: NoiseEstimate) -> str:
    """What visits and markers tell of tracker, joints and model."""
    parts = [
        f"tracker {noise.tracker:.3g} times the stated",
        f"joints return within {noise.joints:.2g} deg",
        f"the model is off by {1e3 * noise.discrepancy:.2g} mm",
    ]
    told = [part for part, known in zip(parts, noise.told, strict=True) if known]
    return f"noise by visits and markers: {', '.join(told)}"


def _accuracy(found: Calibration) -> list[str]:
    """The error to expect in the test pose; nothing without one."""
    lines = []
    if found.verdict == VERDICTS[Severity.ALARM]:
        lines.append("if nothing else were wrong:")
    if found.study.target is not None:
        value, (low, high) = found.fit.accuracy(found.study.target)
        interval = f", with 95 % between {1e3 * low:.5g} and {1e3 * high:.5g} mm"
        lines.append(f"rho0 {1e3 * value:.5g} mm{'' if low == high else interval}")
    if found.budget is not None:
        lines.append(error_budget(found.budget))
    if found.study.target is not None:
        lines.append(str(found.expected))
    if found.rho0_bias and not found.fitted.nonlinear:
        bias = f"{1e3 * found.rho0_bias:.3g} mm"
        lines.append(f"beside it the linear model leaves an error of {bias}")
    return lines


def _rows(found: Calibration) -> list[str]:
    """The pose that fits least, the row that counts most, and the outliers."""
    fit = found.fit
    pose = found.data.pose
    lengths = found.data.lengths
    squares = np.bincount(pose, np.where(lengths, fit.residual**2, 0.0).sum(axis=1))
    of_pose = squares / np.maximum(np.bincount(pose, lengths.sum(axis=1)), 1)
    worst = int(of_pose.argmax())
    size = f"{1e3 * np.sqrt(of_pose[worst]):.4g} mm"
    i, j = np.unravel_index(fit.leverage.argmax(), fit.leverage.shape)
    turn = found.data.turn
    column = coordinate_columns(fit.residual.shape[1])[j]
    column = column if turn is None or not turn[i] else TURN_COLUMN
    lines = [
        f"largest residuals in pose {worst + 1}: {size} root mean square",
        f"largest leverage {fit.leverage[i, j]:.3f}: row {i + 1}, {column}",
    ]
    if len(fit.outliers):
        rows = row_names(fit.outliers.tolist())
        lines.append(f"outliers ({len(fit.outliers)}): {rows}")
    return lines
