"""From a filled-in sheet to compliances, with everything that a person wants to know."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from edtk.calibration.calibration import Origin
from edtk.calibration.spring_calibration import SpringCalibration
from edtk.calibration.told_part import ToldPart, measured_known, told_part
from edtk.findings.causes.faults import cause_of
from edtk.findings.finding import Finding, worst_first
from edtk.findings.fitted_data import AS_USUAL, FittedData, HowFitted
from edtk.findings.moving_joints import stated_noise
from edtk.findings.nonlinear_part import linear_model_bias
from edtk.findings.prior import known_findings, unstated_findings
from edtk.findings.springs import find_input_error, spring_findings, still_joints, untold_finding
from edtk.fit.correlated_noise import NotPositiveDefiniteError
from edtk.fit.fit_huber import SigmaTooSmallError
from edtk.fit.identify import NothingLeftError
from edtk.fit.least_squares import SingularPlanError
from edtk.fit.measurements import Measurements
from edtk.fit.noise import TooManyVisitsError
from edtk.measure.pose_table import Table, path_of
from edtk.robots.loads.fixed_load import FixedLoad
from edtk.study.study import Study
from edtk.study.study_model import study_sigma
from edtk.study.study_parts import study_prior
from edtk.system.errors import UserError
from edtk.system.typing import Array

# Numbers by joint, and other ones, that rest on the estimate: with wrong columns they mean nothing.
BY_JOINT = ("k", "std", "k_unbounded")
OTHERS = (
    "correlation",
    "covariance_dof",
    "loo_rms_mm",
    "share_inside_left_out",
    "rho0",
    "rho0_bias",
    "budget_mm",
    "expected_error",
    "prediction",
)


class InputError(UserError):
    """Measurements are certainly wrong.

    Attributes:
        finding: The first error, with rows and columns.
        calibration: The calibration of the sheet as it is, which is not to be used, with the causes
            of the error.
    """

    def __init__(self, path: Path, finding: Finding, calibration: SpringCalibration) -> None:
        super().__init__(finding.words, where=path)
        self.finding = finding
        self.calibration = calibration


def misread_sheet(found: SpringCalibration) -> dict[str, Any] | None:
    """Name the causes of a sheet that was taken as it is, without the estimate.

    A person reads one line that says which columns look misread, and no result. A program asks for
    the causes and the verdict, and is not to read compliances that are known to be wrong.

    Args:
        found: The calibration of the sheet as it is.

    Returns:
        The keys of its `to_dict`, where all that rests on the estimate is null; None where no
        columns are misread.
    """
    if not any(cause_of(one) for one in found.findings):
        return None
    said = found.to_dict()
    joints = found.study.specification.joints.unknown
    empty = {name: dict.fromkeys(joints) for name in BY_JOINT}
    return {**said, **empty, **dict.fromkeys(OTHERS), "k_bias": None}


def calibrate(study: Study, path: Table, how: HowFitted = AS_USUAL) -> SpringCalibration:
    """Identify the study's unknown compliances from a measurement file.

    Args:
        study: The question.
        path: The measurements (CSV, or a data frame), see `Measurements.from_csv`; poses need not
            be feasible.
        how: How they are fitted. Poses that are not in its plan are an input error, and planned
            experiments that were not made are among the findings. As it is, an input error is only
            a finding, an alarm, beside the result. Without a posterior to come, measurements may
            leave open what is not of interest, where the study says what is.

    Returns:
        Compliances by joint, the fit, and the findings.

    Raises:
        InputError: The measurements are certainly wrong; names rows and columns.
        UserError: The file cannot be read or does not identify all parameters; names row and
            column of a bad cell.
    """
    data = _read(study, path)
    origin = Origin.of(path)
    path = path_of(path)
    try:
        fitted, part = _fitted(study, data, how)
    except (SingularPlanError, NothingLeftError, SigmaTooSmallError) as error:
        raise UserError(str(error), where=path) from error
    fitted = fitted.naming_outliers()
    bare = SpringCalibration(
        fitted, _bias(fitted), findings=(), path=path, origin=origin, part=part
    )
    tasks = fitted.study.tasks
    budget = bare.propagation.budget(tasks, bare.rho0_bias or 0.0) if tasks else None
    named = spring_findings(fitted, bare.rho0_bias, budget)
    lacking = fitted.model_error
    if budget is not None and lacking is not None and bare.propagation.model is not None:
        left = bare.propagation.model.in_tasks(tasks, bare.propagation.joints, budget)
        named = (*named, *left.findings(lacking.to_dict(), lacking.counts))
    if part is not None and study.interest is None:
        told = (len(fitted.fit.k), len(study.unknown))
        still = still_joints(study.robot, data.q)
        named = (untold_finding(told, part.words, still, "; or a [prior], with --bayes"), *named)
    if study.with_known is not study:
        beside = {one.name: one for one in bare.propagation.assumed}
        named = (*named, *known_findings(study, beside))
        if budget is not None:
            errors = bare.propagation.known_errors(study, tasks)
            named = (*named, *unstated_findings(study, errors, budget.total))
    found = replace(bare, findings=worst_first(named), budget=budget)
    if tasks:
        vars(found)["propagation"] = bare.propagation  # of the same fit
    wrong = None if how.as_is else find_input_error(fitted)
    if wrong is not None:
        raise InputError(path, wrong, found)
    return found


def _bias(fitted: FittedData) -> Array | None:
    """By how far the linear model makes the compliances (p,) too large; None if it is unknown."""
    if fitted.untold:
        return None
    if fitted.nonlinear:
        return np.zeros(len(fitted.fit.k))
    if fitted.study.target is None:
        return None
    return linear_model_bias(fitted.study, fitted.data, fitted.linear_regressor, fitted.fit.k)


def _read(study: Study, path: Table) -> Measurements:
    """The measurements with the noise that the study's [noise] states.

    Raises:
        UserError: The file cannot be read, a measurement has no noise in some direction, or too
            many share an error.
    """
    load = study.space.load
    wrench = load.always if isinstance(load, FixedLoad) else None
    data = Measurements.from_csv(
        path,
        study.robot,
        study.fixed,
        wrench,
        study_sigma(study),
        study.model,
        study.is_absolute,
    )
    try:
        return stated_noise(study, data)
    except (NotPositiveDefiniteError, TooManyVisitsError) as error:
        raise UserError(str(error), where=path_of(path)) from error


def _fitted(study: Study, data: Measurements, how: HowFitted) -> tuple[FittedData, ToldPart | None]:
    """The fit, of what is told where that is a part of the compliances.

    With a posterior to come, a prior tells the rest. Otherwise the rest stays open: that is said,
    unless the study says what is of interest.
    """
    study = measured_known(study, data, how)
    try:
        return FittedData.of(study, data, how), None
    except SingularPlanError as error:
        untold = error.parameters
        if how.sampled:
            prior = study_prior(study)
            return FittedData.with_prior(study, data, prior, untold, how), None
        part = told_part(study, data)
        if part is None:
            raise
    return FittedData.of(part.study, data, how), part
