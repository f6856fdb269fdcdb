"""Posteriors in NetCDF files, with the displacements of all task poses."""

import warnings

import numpy as np
import pandas as pd
import pytest
from readings import PLAN, STUDY

from edtk.calibration import posterior_check as module
from edtk.calibration.posterior_check import PosteriorCheck, inference_data
from edtk.fit.noise import Noise
from edtk.fit.posterior import Posterior

pytestmark = pytest.mark.slow  # ArviZ takes seconds to import

POSE = STUDY.to_dict()["test_pose"]
SEVERAL = STUDY.replace(
    test_pose=[POSE, POSE | {"q_deg": [0, -60, 90, 10, 45, 30]}], published=None
)
SAMPLES = STUDY.compliances * np.random.default_rng(0).uniform(0.9, 1.1, (6, 4, 5))


def check(tasks=()):
    """A posterior of a few draws."""
    names = STUDY.model.parameters
    nothing = np.zeros(0)
    posterior = Posterior(SAMPLES, np.ones(5), 6, np.ones(5), nothing, np.zeros((6, 4, 0)))
    table = pd.DataFrame({"parameter": names, "unit": STUDY.model.units})
    A = STUDY.model.regressor(PLAN.q, PLAN.wrench)
    sigma = np.tile(STUDY.sigma, (len(A), 1))
    return PosteriorCheck(
        table, "identified", posterior, A, A @ SAMPLES[0, 0], sigma, Noise(), None, tasks=tasks
    )


def read(tmp_path, content):
    """The file as ArviZ reads it."""
    path = tmp_path / f"{len(list(tmp_path.iterdir()))}.nc"  # ArviZ reads files as late as it can
    path.write_bytes(content)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import arviz

        return arviz.from_netcdf(str(path))


def test_several_poses_have_a_displacement_each(tmp_path):
    """Each draw has the displacement of each pose; one pose alone has the same without an axis."""
    data = read(tmp_path, inference_data(check(SEVERAL.tasks)))
    moved = data.posterior["displacement"]
    assert moved.dims == ("chain", "draw", "task_pose", "axis")
    assert moved.units == "m"
    for i, task in enumerate(SEVERAL.tasks):
        expected = np.swapaxes(SAMPLES, 0, 1) @ task.regressor.T
        np.testing.assert_allclose(moved[:, :, i], expected, rtol=1e-12)
        np.testing.assert_array_equal(data.constant_data["task_regressor"][i], task.regressor)
    one = read(tmp_path, inference_data(check(STUDY.tasks)))
    assert one.posterior["displacement"].dims == ("chain", "draw", "axis")
    np.testing.assert_allclose(one.posterior["displacement"], moved[:, :, 0], rtol=1e-12)
    assert "displacement" not in read(tmp_path, inference_data(check())).posterior


def test_very_many_displacements_are_left_out(tmp_path, monkeypatch: pytest.MonkeyPatch):
    """The regressors of the poses are there all the same."""
    monkeypatch.setattr(module, "MOST_NUMBERS", 100)
    data = read(tmp_path, inference_data(check(SEVERAL.tasks)))
    assert "displacement" not in data.posterior
    assert data.constant_data["task_regressor"].shape == (2, 3, 5)
