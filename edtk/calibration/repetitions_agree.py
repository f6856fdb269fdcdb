"""Whether repetitions agree better with each other than with the model that was fitted."""

from typing import TYPE_CHECKING

import numpy as np

from edtk.calibration.moving_joints import visits_lack_of_fit
from edtk.inference.lack_of_fit import LackOfFit, lack_of_fit
from edtk.inference.least_squares import SingularPlanError, Whitened
from edtk.inference.whiten import whiten

if TYPE_CHECKING:
    from edtk.calibration.fitted_data import FittedData


def repetitions_agree(fitted: "FittedData") -> LackOfFit | None:
    """Test repetitions, or visits where joints move all markers of one.

    A reading that is off by itself disagrees with the model and not with what is not repeated, or
    with its repetitions: either way it says nothing of noise, and counts as not measured.

    Returns:
        The test; None where nothing is repeated, or not all parameters are told.
    """
    if fitted.untold:
        return None
    data = fitted.data
    found = fitted.noise_estimate
    if found is not None and data.tracker is None:
        others, seen = fitted.others
        return visits_lack_of_fit(fitted.study, others, seen, found)
    p = len(fitted.fit.k)
    test = lack_of_fit(whiten(fitted.fit.residual, data.noise), data.places, p)
    if test is None or not (test.seen or len(fitted.fit.outliers)):
        return test  # nothing was found that an outlier could have made
    if not fitted.found_causes.outliers:
        return test
    rows = np.delete(np.arange(len(data)), fitted.found_causes.outliers)
    rest = data[rows]
    try:
        whitened = Whitened.of(fitted.linear_regressor[rows], rest.noise, fitted.fit.parameters)
    except SingularPlanError:
        return test
    return lack_of_fit(whitened.residual(fitted.as_linear[rows]), rest.places, p)
