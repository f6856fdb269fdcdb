"""The error in several test poses by a posterior."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from kr270 import REQUIRED, TEST_POSE

from edtk.calibration.posterior_check import pose_error
from edtk.fit.least_squares import Estimate
from edtk.study.study import Study

OTHER = TEST_POSE | {"q_deg": [0, -60, 90, 10, 45, 30], "load": {"F_N": [900, -900, 300]}}
COV = 1e-16 * np.diag([1.0, 4.0, 2.0, 3.0, 1.0])
FIT = Estimate(np.full(5, 1e-6), COV)


def posterior(seed: int) -> Any:
    """Independent draws of the normal density of the fit."""
    rng = np.random.default_rng(seed)
    return SimpleNamespace(samples=rng.multivariate_normal(FIT.k, COV, size=(2000, 4)))


def test_several_poses_have_a_mean_and_one_displacement() -> None:
    """rho0 is the root mean square over the poses, and the displacement that of the worst."""
    study = Study(**REQUIRED, test_pose=[TEST_POSE, OTHER])
    found = pose_error(study.tasks, FIT, posterior(0))
    assert found.rho0 == pytest.approx(found.rho0_fit, rel=0.03)
    each = [pose_error(type(study.tasks)([task]), FIT, posterior(0)) for task in study.tasks]
    mean = np.sqrt(np.mean([one.rho0**2 for one in each]))
    assert found.rho0 == pytest.approx(mean, rel=1e-9)
    assert found.displaced == 1 + int(np.argmax([one.rho0 for one in each]))
    np.testing.assert_array_equal(found.displacement, each[found.displaced - 1].displacement)
    assert found.place == "in 2 test poses"
    assert "displaced" not in each[0].to_dict()
