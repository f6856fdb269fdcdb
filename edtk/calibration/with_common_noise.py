"""A fit that takes into account the noise which repetitions or visits share."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from edtk.calibration.moving_joints import moving_joints, shared_by_repetitions
from edtk.inference.fit_common_noise import fit_common_noise
from edtk.inference.fit_equilibrium import LinearisedData

if TYPE_CHECKING:
    from edtk.calibration.fitted_data import FittedData

ROUNDS = 4  # of finding outliers; two are the rule


def with_common_noise(fitted: "FittedData") -> "FittedData":
    """The same with the noise that repetitions or visits share, where no fault explains it.

    Outliers are told by the noise, and the noise by rows that are none: each is found anew with the
    other one until they agree.
    """
    if fitted.data.tracker is not None or fitted.fit.robust:
        return fitted  # the study says what visits share
    known = fitted
    for _ in range(ROUNDS):
        found = _with_noise_of(known)
        if np.array_equal(found.fit.outliers, known.fit.outliers):
            return found
        known = replace(fitted, fit=replace(fitted.fit, outliers=found.fit.outliers))
    return found


def _with_noise_of(fitted: "FittedData") -> "FittedData":
    """The same with shared noise as rows have it that are no outliers so far."""
    data = fitted.data
    found = fitted.noise_estimate
    test = fitted.lack_of_fit
    shared = (test is not None and test.seen) or (found is not None and found.moves)
    if not shared or fitted.structural_causes:
        return fitted
    seen = LinearisedData(fitted.A, fitted.measured)
    again = None
    if found is not None:
        again = moving_joints(fitted.study, data, seen, found, fitted.fit)
    elif test is not None and data.covariance is not None:
        again = shared_by_repetitions(data, seen, test, fitted.fit)
    elif test is not None:
        seen, fit = fit_common_noise(seen, data.sigma, data.places, test, fitted.fit)
        return replace(fitted, A=seen.A, measured=seen.measured, fit=fit, common_noise=True)
    if again is None:
        return fitted
    return replace(fitted, fit=again[1], common_noise=True, estimated=again[0])
