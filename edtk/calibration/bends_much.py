"""Whether a robot bends so much that the linear model is not enough."""

import numpy as np

from edtk.calibration.known_part import known_part
from edtk.calibration.some_poses import some_poses
from edtk.inference.identification import Identification
from edtk.inference.least_squares import SingularPlanError, Whitened
from edtk.inference.linearise import linearise
from edtk.inference.measurements import Measurements
from edtk.model.all_compliances import all_compliances
from edtk.model.equilibrium import NoEquilibriumError
from edtk.study.study import Study
from edtk.system.typing import Array

BIAS = 0.1  # of the linear model, in standard deviations, from which the equilibrium is fitted


def bends_much(study: Study, data: Measurements, A: Array, fit: Identification) -> bool:
    """Tell whether the linear fit is biased by more than a tenth of a standard deviation.

    The bias is the first step of the fit of the equilibrium, over some of very many poses.

    Args:
        study: The model.
        data: The measurements.
        A: Their regressors (m, rows, p).
        fit: The linear fit.
    """
    rows = some_poses(data.pose)
    some = data[rows]
    k = all_compliances(study.model, fit.unbounded, study.known)
    try:
        linear = linearise(study.model, some, k)
        whitened = Whitened.of(linear.A, some.noise, study.model.parameters)
    except (NoEquilibriumError, SingularPlanError):
        return False
    linear_part = A[rows] @ fit.unbounded + known_part(study, some)
    curved = linear.constant + linear.A @ fit.unbounded - linear_part
    bias = np.abs(whitened.solve(curved)) / fit.std
    return bool(bias.max() > BIAS)
