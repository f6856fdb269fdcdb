"""What a measurement shows without noise."""

from dataclasses import replace

import numpy as np

from edtk.fit.equilibrium import equilibrium_deflection
from edtk.fit.measurements import Measurements
from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.equilibrium import equilibrium
from edtk.measure.instruments.marker import Marker
from edtk.measure.instruments.pose_marker import PoseMarker
from edtk.robots.frames import BodyPoint
from edtk.robots.load_robot import load_robot
from edtk.robots.rotations import transform

K = np.array([0.0, 0.302, 0.406, 3.002, 3.303, 2.365]) * 1e-6
ROBOT = load_robot("kuka_kr270").with_tool(transform((0.6115, 0.0, -0.460)))
POSITION = ElastostaticModel(ROBOT, (1, 2, 3, 4, 5))
POSE = ElastostaticModel(ROBOT, (1, 2, 3, 4, 5), "pose")
Q = np.random.default_rng(0).uniform(*ROBOT.limits, size=(8, 6))
LOAD = np.array([0, 0, -2500.0, 0, 0, 0])
OFFSET = np.random.default_rng(2).uniform(-0.5, 0.5, (len(Q), 3))


def test_rows():
    """Where positions are measured there are three rows, the first of the six of a whole pose."""
    whole = equilibrium_deflection(POSE, Q, LOAD, K)
    assert whole.shape == (8, 6)
    np.testing.assert_array_equal(equilibrium_deflection(POSITION, Q, LOAD, K), whole[:, :3])


def test_a_marker_moves_like_a_tool_point():
    """A marker's motion is that of a tool point put there."""
    theta = equilibrium(ROBOT, Q, LOAD, K)
    for q, turned, offset in zip(Q, Q + theta, OFFSET, strict=True):
        there = ROBOT.with_tool(ROBOT.tool @ transform(offset))
        moved = there.forward(turned)[:3, 3] - there.forward(q)[:3, 3]
        beside = replace(POSITION, sensors=(Marker(BodyPoint(offset)),))
        found = equilibrium_deflection(beside, q, LOAD, K)
        np.testing.assert_allclose(found, moved, atol=1e-13)


def test_small_loads_are_what_the_regressor_says():
    """Of first order in the load a marker's motion is the one that its regressor promises."""
    load = 1e-4 * LOAD
    beside = replace(POSE, sensors=(PoseMarker(BodyPoint(OFFSET.T)),))
    found = equilibrium_deflection(beside, Q, load, K)
    data = Measurements(Q, np.tile(load, (8, 1)), found, np.ones((8, 6)), OFFSET)
    expected = data.regressor(POSE) @ K[1:]
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(found).max())
