"""The bias of compliances that were identified with the linear model."""

from dataclasses import replace

import numpy as np
from readings import STUDY

from edtk.findings.nonlinear_part import linear_model_bias
from edtk.fit.equilibrium import equilibrium_deflection
from edtk.fit.least_squares import estimate
from edtk.fit.measurements import Measurements
from edtk.measure.instruments.marker import Marker
from edtk.robots.frames import BodyPoint


def test_several_markers():
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
            equilibrium_deflection(
                replace(STUDY.model, sensors=(Marker(BodyPoint(offset)),)), pose, wrench, k
            )
            for pose, wrench, offset in rows
        ]
    )
    A = data.regressor(STUDY.model)
    fit = estimate(A, moved, data.sigma, STUDY.model.parameters)
    found = linear_model_bias(STUDY, data, A, STUDY.compliances)
    np.testing.assert_allclose(found, fit.k - STUDY.compliances, rtol=1e-6)
