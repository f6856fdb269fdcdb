"""The error budget of a calibration, by what its study says of the circumstances."""

import numpy as np

from edtk.calibration.fitted_data import FittedData
from edtk.calibration.propagation import Propagation
from edtk.calibration.some_rows import some_rows
from edtk.calibration.uncertainty import Uncertainty
from edtk.model.error_budget import ErrorBudget
from edtk.study.assumed_joints import assumed_joints
from edtk.study.study import Study
from edtk.study.study_model import payload_beside_load
from edtk.system.typing import Array

MOST_ROWS = 5000  # measurements over which the circumstances are propagated


def calibration_budget(fitted: FittedData, rho0_bias: float | None) -> ErrorBudget | None:
    """Propagate what is uncertain to the study's task; None without a test pose.

    Args:
        fitted: The measurements and their fit.
        rho0_bias: Error that the linear model leaves in the test pose [m]; None if it is unknown.
    """
    study = fitted.study
    if not study.tasks:
        return None
    return propagation_of(fitted).budget(study.tasks, rho0_bias or 0.0)


def propagation_of(fitted: FittedData) -> Propagation:
    """How what is uncertain moves the estimates of a calibration.

    Of very many measurements some are taken, by chance, each of which stands for several: what the
    circumstances do is a mean over the measurements, known to about a per cent from so many.

    Args:
        fitted: The measurements and their fit.
    """
    data = fitted.data
    repeats = None
    if len(data) > MOST_ROWS:
        repeats = np.full(MOST_ROWS, len(data) / MOST_ROWS)
        data = data[some_rows(len(data), MOST_ROWS)]
    k = fitted.fit.k
    # An estimate that may as well be zero says nothing of its neighbours.
    told = np.where(k > fitted.fit.std, k, 0.0)
    uncertainty = uncertainty_of(fitted.study, told)
    return Propagation.of(
        fitted.study.model,
        data,
        k,
        fitted.fit.covariance,
        uncertainty,
        repeats,
        fitted.told_before if fitted.untold else None,
        payload_beside_load(fitted.study),
    )


def uncertainty_of(study: Study, k: Array | None = None) -> Uncertainty:
    """The study's [uncertainty] in SI units.

    Args:
        study: The study.
        k: Compliances (p,) of the unknown joints, see `assumed_joints` [rad/(N m)].
    """
    given = study.specification.uncertainty
    return Uncertainty(
        load_size=given.load_percent / 100,
        load_direction=float(np.deg2rad(given.load_direction_deg)),
        tool=given.tool_mm / 1e3,
        drift=given.drift_mm / 1e3,
        repeatability=given.repeatability_mm / 1e3,
        joints=assumed_joints(study, k),
    )
