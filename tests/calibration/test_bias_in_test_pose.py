"""The bias of the linear model in the test pose."""

import numpy as np
import pytest
from readings import STUDY

from edtk.calibration.bias_in_test_pose import bias_in_test_pose
from edtk.inference.equilibrium_deflection import equilibrium_deflection
from edtk.inference.least_squares import estimate
from edtk.inference.measurements import Measurements


def test_in_the_test_pose_with_several_markers():
    """With rows in any order and several markers it is what each row's own equilibrium gives."""
    rng = np.random.default_rng(0)
    plan = STUDY.published_plans()["table_4_3"]
    order = rng.permutation(12)
    q = np.repeat(plan.q, 4, axis=0)[order]
    W = np.repeat(plan.wrench, 4, axis=0)[order]
    marker = rng.uniform(-0.3, 0.3, (3, 3))[rng.integers(0, 3, 12)]
    data = Measurements(q, W, np.zeros((12, 3)), np.tile(STUDY.sigma, (12, 1)), marker)
    k = np.r_[0, STUDY.compliances]
    rows = zip(q, W, marker, strict=True)
    moved = np.array(
        [
            equilibrium_deflection(STUDY.model, pose, wrench, k, offset)
            for pose, wrench, offset in rows
        ]
    )
    A = data.regressor(STUDY.model)
    fit = estimate(A, moved, data.sigma, STUDY.model.parameters)
    expected = np.linalg.norm(STUDY.target @ (fit.k - STUDY.compliances))
    found = bias_in_test_pose(STUDY, data, A, STUDY.compliances)
    assert found == pytest.approx(expected, rel=1e-9)
