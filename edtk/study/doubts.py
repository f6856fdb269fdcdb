"""What looks wrong in measurements that can be used all the same: units, signs, noise, poses left out."""

import numpy as np
from numpy.typing import NDArray

from edtk.design import Plan, pose_factors
from edtk.inference.identify import Identification
from edtk.inference.measurements import Measurements
from edtk.study.mistakes import far, resolution_of
from edtk.study.study import Study

Array = NDArray[np.float64]


def doubts(
    study: Study, data: Measurements, A: Array, fit: Identification, plan: Plan | None = None
) -> tuple[str, ...]:
    """Lines about what looks wrong, for a person; none where nothing does.

    Args:
        study: The question; its assumed true compliances, if it has any, say how large deflections are.
        data: The measurements.
        A: Their regressors (m, rows, p).
        fit: What they gave.
        plan: The plan that was to be carried out.
    """
    units = _units(study, data, A, fit)
    return (*file_doubts(study, data, A, fit, plan), *_signs(study, fit), *([] if units else _noise(fit)))


def file_doubts(
    study: Study, data: Measurements, A: Array, fit: Identification, plan: Plan | None = None
) -> tuple[str, ...]:
    """Those of them that are about the file and not about the fit; arguments as for `doubts`."""
    poses = [] if plan is None else _not_measured(study, data, plan)
    return (*_units(study, data, A, fit), *poses)


def _units(study: Study, data: Measurements, A: Array, fit: Identification) -> list[str]:
    """Numbers that look like those of another unit."""
    return _lengths(study, data, A, fit) + _rotations(study, data, A) + _angles(study, data)


def _ratio(study: Study, data: Measurements, A: Array, columns: slice) -> float | None:
    """Size of what was measured over that of what the assumed compliances predict; None without a prediction."""
    given = {} if study.file.simulation is None else study.file.simulation.compliance_rad_per_Nm
    if any(name not in given for name in study.file.joints.unknown):
        return None
    predicted = np.linalg.norm((A @ study.compliances)[:, columns])
    return float(np.linalg.norm(data.deflection[:, columns]) / predicted) if predicted > 0 else None


def _lengths(study: Study, data: Measurements, A: Array, fit: Identification) -> list[str]:
    """Displacements a thousand times too small or too large, within a factor of ten.

    Beside the prediction where there is one; else the residuals beside sigma, where there are enough of them.
    """
    ratio = _ratio(study, data, A, slice(3))
    what = "the displacements are {:.2g} times those that the study's [simulation] predicts"
    if ratio is None and fit.dof >= 5:
        ratio, what = fit.scale, "the residuals are {:.2g} times sigma"
    if ratio is not None and 1e-4 < ratio < 1e-2:
        return [f"{what.format(ratio)}: are they in metres? expected millimetres"]
    if ratio is not None and 1e2 < ratio < 1e4:
        return [f"{what.format(ratio)}: are they in micrometres? expected millimetres"]
    return []


def _rotations(study: Study, data: Measurements, A: Array) -> list[str]:
    """Rotations 57 times too small, within a factor of three."""
    ratio = _ratio(study, data, A, slice(3, 6)) if data.deflection.shape[1] == 6 else None
    if ratio is None or not 1 / 3 < ratio * 180 / np.pi < 3:
        return []
    return [f"the rotations are {ratio:.2g} times those predicted: are they in radians? expected degrees"]


def _angles(study: Study, data: Measurements) -> list[str]:
    """Several poses, all of them within 2 pi degrees of zero."""
    turning = [j for j, joint in enumerate(study.robot.joints) if joint.kind == "revolute" and j not in study.fixed]
    degrees = np.rad2deg(data.q[:, turning])
    if not turning or np.abs(degrees).max() > 2 * np.pi or not np.ptp(degrees, axis=0).any():
        return []
    return ["all joint angles are within 6.3 degrees of zero: are they in radians? expected degrees"]


def _signs(study: Study, fit: Identification) -> list[str]:
    """Compliances that come out negative."""
    if fit.negative.all():
        return [
            "every compliance comes out negative, and was set to zero: are the loaded and the unloaded positions "
            "swapped, or has the load the wrong sign?"
        ]
    named = [
        f"{name} = {k:.2g} +- {std:.2g}"
        for name, k, std, yes in zip(study.model.parameters, fit.unbounded, fit.std, fit.negative, strict=True)
        if yes
    ]
    return [f"{', '.join(named)} rad/(N m): negative; the best fit without negative compliances is given"] * bool(named)


def _not_measured(study: Study, data: Measurements, plan: Plan) -> list[str]:
    """Planned poses that were not measured."""
    factors = pose_factors(study.robot)
    rows = far(plan.q / factors, data.q / factors, resolution_of(study))
    return [f"{_named('pose', rows)} of the plan: not measured"] * bool(rows)


def _named(what: str, rows: list[int]) -> str:
    """Some rows, counted from 1."""
    shown = ", ".join(str(i + 1) for i in rows[:10])
    return f"{what}{'s' * (len(rows) > 1)} {shown}{f' and {len(rows) - 10} more' if len(rows) > 10 else ''}"


def _noise(fit: Identification) -> list[str]:
    """A chi-square that the given sigma makes improbable."""
    if fit.p_value is None or 1e-3 <= fit.p_value <= 1 - 1e-3:
        return []
    why = "sigma is too small, there are outliers, or the model does not fit" if fit.scale > 1 else "sigma is too large"
    return [f"the residuals are {fit.scale:.3g} times what sigma says: {why}; see --sigma-unknown and --robust"]
