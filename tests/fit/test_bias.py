"""The bias of the linear model on a robot that is not linear."""

import numpy as np
import pytest

from edtk.fit.equilibrium import equilibrium_deflection, linearisation_bias
from edtk.fit.least_squares import SingularPlanError, estimate
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.robots.load_robot import load_robot
from edtk.robots.rotations import transform

K = np.array([0.0, 0.302, 0.406, 3.002, 3.303, 2.365]) * 1e-6
MODEL = ElastostaticModel(
    load_robot("kuka_kr270").with_tool(transform((0.6115, 0.0, -0.460))), (1, 2, 3, 4, 5)
)
Q = np.random.default_rng(0).uniform(*MODEL.robot.limits, size=(8, 6))
LOAD = np.array([0, 0, -2500.0, 0, 0, 0])
SIGMA = 0.03e-3


def test_bias_is_the_mean_of_noisy_fits():
    """The mean of 20000 linear fits to noisy equilibria is the expected one within five errors."""
    found = linearisation_bias(MODEL, Q, LOAD, SIGMA, K)
    measured = equilibrium_deflection(MODEL, Q, LOAD, K)
    noisy = measured + SIGMA * np.random.default_rng(1).standard_normal((20_000, *measured.shape))
    k = estimate(MODEL.regressor(Q, LOAD), noisy, SIGMA, MODEL.parameters).k
    assert (np.abs(k.mean(axis=0) - found.expected) < 5 * found.std / np.sqrt(len(k))).all()
    np.testing.assert_allclose(k.std(axis=0), found.std, rtol=0.03)


def test_bias_is_of_first_order_in_the_load():
    """The bias halves with the load; in standard deviations it falls to a quarter."""
    sizes = 2.0 ** -np.arange(5)
    found = [linearisation_bias(MODEL, Q, s * LOAD, SIGMA, K) for s in sizes]
    for values, order in ((lambda b: b.percent, 1.0), (lambda b: b.in_std, 2.0)):
        slope = np.polyfit(np.log(sizes), np.log([np.linalg.norm(values(b)) for b in found]), 1)[0]
        assert slope == pytest.approx(order, abs=0.03)


def test_properties_agree():
    """Bias in standard deviations, in per cent and in a pose are the same bias."""
    b = linearisation_bias(MODEL, Q, LOAD, SIGMA, K)
    np.testing.assert_allclose(b.bias, b.expected - K[1:])
    np.testing.assert_allclose(b.in_std * b.std, b.bias)
    np.testing.assert_allclose(b.percent * K[1:] / 100, b.bias)
    assert repr(b).startswith("<Bias: 5 compliances, off by ")
    A = MODEL.regressor(Q[0], LOAD)
    assert b.in_pose(A) == pytest.approx(np.linalg.norm(A @ b.bias))


def test_joint_that_is_not_identified_bends_too():
    """A compliance that the model leaves out is ascribed to the others if the load excites it."""
    W = np.array([0, 1500.0, -2500.0, 0, 0, 0])
    rigid = linearisation_bias(MODEL, Q, W, SIGMA, K)
    bending = linearisation_bias(MODEL, Q, W, SIGMA, K + 4e-7 * np.eye(6)[0])
    assert np.abs(bending.in_std).max() > 5 * np.abs(rigid.in_std).max()


def test_rotations_are_measured_too():
    """With six rows the bias vanishes with the load too."""
    model = ElastostaticModel(MODEL.robot, MODEL.unknown, "pose")
    sigma = np.r_[np.full(3, SIGMA), np.full(3, 1e-4)]
    assert np.abs(linearisation_bias(model, Q, 1e-3 * LOAD, sigma, K).percent).max() < 0.01


def test_zero_compliance_and_singular_plan():
    """A rigid joint's bias has no percentage and no warning; a singular plan is refused."""
    k = K * [0, 1, 1, 1, 1, 0]
    assert np.isinf(linearisation_bias(MODEL, Q, LOAD, SIGMA, k).percent[-1])
    with pytest.raises(SingularPlanError, match="cannot identify"):
        linearisation_bias(MODEL, Q[:1], LOAD, SIGMA, K)
