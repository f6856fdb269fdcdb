"""A reading that is off by itself is no noise that repetitions share."""

from dataclasses import replace

import numpy as np
import pytest
from readings import PLAN, STUDY, readings_of

from edtk.findings.fitted_data import FittedData, HowFitted
from edtk.fit.correlated_noise import whiten
from edtk.fit.outliers import lack_of_fit

POSES = np.random.default_rng(3).uniform(*STUDY.model.robot.limits, size=(5, 6))
Q = np.repeat(POSES, (5, 3, 2, 1, 1), axis=0)  # the last two poses are measured once


def sheet(seed, off):
    """Readings of which the last one is off by so many standard deviations along one axis."""
    data = readings_of(Q, np.tile(PLAN.wrench[0], (len(Q), 1)), seed)
    moved = data.deflection.copy()
    moved[-1, seed % 3] += off * STUDY.sigma[0]
    return replace(data, deflection=moved)


@pytest.mark.slow
def test_outlier_of_a_pose_measured_once():
    """It is off the model and no repetition is: that is no common noise, and the row is named."""
    fitted = FittedData.of(STUDY, sheet(0, off=12), HowFitted(linear=True)).naming_outliers()
    z = whiten(fitted.fit.residual, fitted.data.noise)
    of_all = lack_of_fit(z, fitted.data.places, STUDY.model.p)
    assert of_all.seen
    assert not fitted.lack_of_fit.seen
    assert not fitted.common_noise
    assert fitted.fit.outliers.tolist() == [len(Q) - 1]
    others = FittedData.of(STUDY, sheet(0, off=0)[np.arange(len(Q) - 1)], HowFitted(linear=True))
    np.testing.assert_allclose(fitted.lack_of_fit.F, others.lack_of_fit.F, rtol=1e-9)


def test_good_readings_are_all_compared():
    """Without an outlier the test is that of all readings."""
    fitted = FittedData.of(STUDY, sheet(0, off=0))
    assert fitted.naming_outliers() is fitted
    z = whiten(fitted.fit.residual, fitted.data.noise)
    assert fitted.lack_of_fit == lack_of_fit(z, fitted.data.places, STUDY.model.p)
