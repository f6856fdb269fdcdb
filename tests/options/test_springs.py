"""Poses left out, predictions and untold joints where displacements tell springs."""

from dataclasses import replace

import numpy as np
import pytest
from kr270 import REQUIRED, TEST_POSE

from edtk.findings.fitted_data import FittedData
from edtk.findings.moving_joints import stated_noise
from edtk.findings.noise import left_out_findings
from edtk.fit.correlated_noise import std_of
from edtk.fit.distributions import student_quantile
from edtk.fit.least_squares import estimate
from edtk.fit.measurements import Measurements, simulate
from edtk.study.study import Study

K = np.array([3e-7, 4e-7, 2.8e-6, 2.8e-6, 2.1e-6])
TRACKER = {"tracker_position_mm": [4000, -3500, 1200], "along": [10, 0.5], "across": [15, 6]}
MOVING = {"repeatability_deg": 0.003, "discrepancy_mm": 0.02}


def day(seed, poses=8, repeats=2, linear=True, **keys):
    """A study and measurements of random poses, of a robot that bends by the linear model."""
    study = Study(**REQUIRED | {"test_pose": TEST_POSE} | keys)
    rng = np.random.default_rng(seed)
    q = np.repeat(study.space.draw(rng.random((poses, 6)))[:, :6], repeats, axis=0)
    none = np.zeros((len(q), 3))
    wrench = np.tile(study.space.load.always, (len(q), 1))
    data = stated_noise(study, Measurements(q, wrench, none, none + 3e-5, none))
    moved = simulate(data.regressor(study.model), K, data.noise, rng)[0]
    return study, replace(data, deflection=moved)


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("noise", [None, TRACKER, MOVING], ids=["white", "tracker", "moving"])
def test_a_pose_left_out_is_what_a_fit_without_it_predicts(noise, known):
    """Errors and bands are those of least squares from the other poses alone."""
    study, data = day(0, noise=noise)
    fitted = FittedData.of(study, data, known=known, linear=True)
    out = fitted.left_out
    size = 1.0 if known else fitted.fit.scale
    t = student_quantile(0.975, fitted.fit.covariance_dof)
    for pose in range(8):
        rest = np.flatnonzero(data.pose != pose)
        own = np.flatnonzero(data.pose == pose)
        A = fitted.A[own]
        other = estimate(fitted.A[rest], fitted.measured[rest], data.noise[rest], ())
        errors = fitted.measured[own] - A @ other.k
        np.testing.assert_allclose(out.errors[own], errors, atol=1e-9 * np.abs(errors).max())
        spread = np.einsum("mrp,pq,mrq->mr", A, other.covariance, A)
        half = t * size * np.sqrt(std_of(data.noise)[own] ** 2 + spread)
        np.testing.assert_allclose(out.half[own], half, rtol=1e-9)


def test_what_one_pose_alone_tells_is_not_predicted():
    """Two poses of five springs: coordinates that only their own pose tells have no error."""
    study, data = day(0, 2, 1)
    out = FittedData.of(study, data, linear=True).left_out
    assert np.isnan(out.errors).any()
    assert np.isinf(out.growth()).any()


def test_readings_that_bands_do_not_hold_are_found():
    """A day on which one pose in four errs ten times as much is named, and a sound day is not."""
    for wild, kinds in ((1.0, []), (10.0, ["outside"])):
        study, data = day(3, 24, 1)
        clean = data.regressor(study.model) @ K
        often = np.where(data.pose % 4, 1.0, wild)[:, None]
        moved = clean + often * (data.deflection - clean)
        fitted = FittedData.of(study, replace(data, deflection=moved), linear=True)
        out = fitted.left_out
        found = left_out_findings(out.share_inside, out.independent, False, False)
        assert [one.kind for one in found] == kinds
