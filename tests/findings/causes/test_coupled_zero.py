"""A zero of a motor that turns several joints, as a cause of residuals."""

import numpy as np
import pytest

from edtk.findings.causes.scene import Positions
from edtk.measure.measured_model import MeasuredModel
from edtk.robots.load_robot import load_robot
from edtk.robots.rotations import transform

ROBOT = load_robot("palletiser").with_tool(transform((0.3, 0.1, 0.2)))
MODEL = MeasuredModel(ROBOT, np.zeros((1, 3)), ("M",), ())
Q = np.random.default_rng(2).uniform(*ROBOT.limits, (5, 4))


def columns(parameters, wrench):
    """How the tool point moves with errors of the drawing (m, 3, p)."""
    model = MODEL.with_parameters(parameters)
    return model.see(np.zeros(model.p), Q).jacobian[:, 0]


@pytest.mark.parametrize("joint", range(4))
def test_a_wrong_zero_moves_all_that_its_motor_moves(joint):
    """The upper arm's motor leaves the forearm level, and that of the forearm the flange."""
    A = np.zeros((5, 3, 0))
    nothing = np.zeros(0)
    scene = Positions(
        ROBOT, ("M",), columns, A, nothing, Q, np.zeros((5, 6)), np.arange(5.0), (), nothing, None
    )
    found = scene.counted(joint)(np.array([1.0]))[1]
    step = 1e-6 * np.eye(4)[joint]
    ends = [ROBOT.forward(Q + sign * step)[:, :3, 3] for sign in (1, -1)]
    np.testing.assert_allclose(found, (ends[0] - ends[1]) / 2e-6, atol=1e-8)
