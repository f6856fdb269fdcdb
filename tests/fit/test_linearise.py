"""The derivative of the loaded equilibrium by the compliances."""

import numpy as np
import pytest
from chains import mixed_chain

from edtk.fit.equilibrium import linearise
from edtk.fit.measurements import Measurements
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import Rest

RNG = np.random.default_rng(0)
ROBOT = mixed_chain()
Q = RNG.uniform(*ROBOT.limits, size=(6, ROBOT.n))
WRENCH = np.hstack([300 * RNG.standard_normal((6, 3)), 50 * RNG.standard_normal((6, 3))])
# One is negative, as an estimate may be; deflections are up to some degrees.
K = np.array([2.0, 3.0, 4.0, 28.0, 1.0, -0.5, 21.0]) * 1e-6


def sheet(marker, rows="pose"):
    """Measurements of the poses, the first of them twice; measured values are zero."""
    order = [0, 0, 1, 2, 3, 4, 5]
    width = 6 if rows == "pose" else 3
    offset = marker * RNG.standard_normal((7, 3))
    empty = np.zeros((7, width))
    return Measurements(Q[order], WRENCH[order], empty, empty + 1, offset)


@pytest.mark.parametrize("marker", [0.0, 0.2])
@pytest.mark.parametrize("rows", ["position", "pose"])
def test_derivative_is_that_of_the_equilibrium(rows, marker, derivative):
    """A is the derivative of the markers' motion, and the constant closes the gap, to 1e-9."""
    data = sheet(marker, rows)
    model = ElastostaticModel(ROBOT, (0, 1, 3, 5, 6), rows)

    def motion(unknown):
        k = K.copy()
        k[model.joints] = unknown
        return data.changes(model, Rest.of(model, Q, WRENCH, k, signed=True))

    found = linearise(model, data, K)
    expected = derivative(motion, K[model.joints], h=1e-8)
    np.testing.assert_allclose(found.A, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    moved = found.constant + found.A @ K[model.joints]
    np.testing.assert_allclose(moved, motion(K[model.joints]), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("rows", ["position", "pose"])
def test_about_a_rigid_robot_it_is_the_linear_model(rows):
    """At k = 0 the derivative is Eq. (4), and nothing is added."""
    data = sheet(0.2, rows)
    model = ElastostaticModel(ROBOT, None, rows)
    found = linearise(model, data, np.zeros(ROBOT.n))
    expected = data.regressor(model)
    np.testing.assert_allclose(found.A, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    assert not found.constant.any()
