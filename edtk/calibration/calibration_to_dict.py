"""A calibration as plain numbers."""

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from edtk.calibration.calibration import Calibration


def calibration_to_dict(found: "Calibration") -> dict[str, Any]:
    """Plain numbers, SI, for JSON; a number that is not known is null."""
    fit = found.fit
    study = found.study
    joints = study.specification.joints
    return {
        "k": _known(found.k),
        "std": _known(found.std),
        "correlation": fit.correlation.tolist(),
        "covariance_dof": fit.covariance_dof if np.isfinite(fit.covariance_dof) else None,
        "sigma_hat": found.sigma_hat if np.isfinite(fit.scale) else None,
        "chi2": fit.chi2,
        "dof": fit.dof,
        "p_value": fit.p_value,
        "outliers": (fit.outliers + 1).tolist(),
        "rho0": _rho0(found),
        "rho0_bias": found.rho0_bias,
        "model": "nonlinear" if found.fitted.nonlinear else "linear",
        "budget_mm": None if found.budget is None else found.budget.to_dict(),
        **_all_uncertain(found),
        "lack_of_fit": None if found.lack_of_fit is None else found.lack_of_fit.to_dict(),
        "noise": None if found.noise is None else found.noise.to_dict(),
        "causes": [cause.to_dict() for cause in found.causes],
        "expected_error": None if found.expected is None else found.expected.to_dict(),
        **({} if found.tasks is None else {"tasks": found.tasks.to_dict()}),
        "verdict": found.verdict,
        "doubts": [diagnostic.text for diagnostic in found.diagnostics],
        "study_warnings": list(study.warnings),
        "diagnostics": [diagnostic.to_dict() for diagnostic in found.diagnostics],
        "negative": [joints.unknown[i] for i in np.flatnonzero(fit.negative)],
        "known": {name: one.value for name, one in joints.known.items()},
        "k_unbounded": _known(found.by_joint(fit.unbounded)),
        "k_bias": None if found.bias is None else _known(found.by_joint(found.bias)),
        "posterior": None if found.check is None else found.check.to_dict(),
        **_of_interest(found),
    }


def _all_uncertain(found: "Calibration") -> dict[str, Any]:
    """All that commands may be off by; null without a task."""
    if found.budget is None:
        return {"covariance_measured": None, "assumed_joints": None}
    unknown = found.study.specification.joints.unknown
    parts = {one.joint.name: one.to_dict() for one in found.budget.joints}
    errors = found.propagation.errors
    return {
        "covariance_measured": found.propagation.measured.tolist(),
        "assumed_joints": [
            parts[one.joint.name]
            | {"shifts_rad_per_Nm": dict(zip(unknown, one.shifts.tolist(), strict=True))}
            for one in errors
        ],
    }


def _rho0(found: "Calibration") -> dict[str, Any] | None:
    """The accuracy in the task with its interval; None without a task."""
    if found.study.target is None:
        return None
    value, interval = found.fit.accuracy(found.study.target)
    return {"value": value, "interval95": list(interval)}


def _of_interest(found: "Calibration") -> dict[str, Any]:
    """What is of interest, and what is not told; nothing where all compliances matter."""
    if found.asked.interest is None:
        return {}
    told = {name: {"value": k, "std": std} for name, (k, std) in found.interest.items()}
    return {"interest": told, "not_told": [] if found.part is None else list(found.part.open)}


def _known(values: dict[str, float]) -> dict[str, float | None]:
    """The same, with None for no number, as JSON has it."""
    return {name: None if np.isnan(value) else value for name, value in values.items()}
