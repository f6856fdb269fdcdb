"""Motions of markers by the joints."""

import numpy as np

from edtk.fit.measurements import joint_motion
from edtk.robots.rotations import transform
from tests.support.visits import MODEL, visited


def test_derivatives_against_differences():
    """Each joint moves each marker as differences of its position say."""
    data = visited(poses=3)
    found = joint_motion(MODEL, data)
    step = 1e-6
    for j in range(6):
        for row in (0, 4, 17):
            tip = transform(data.marker[row])
            at = [
                (MODEL.robot.forward(data.q[row] + s * step * np.eye(6)[j]) @ tip)[:3, 3]
                for s in (1, -1)
            ]
            np.testing.assert_allclose(found[row, :, j], (at[0] - at[1]) / (2 * step), atol=1e-8)


def test_the_regressor_is_a_motion_of_the_joints():
    """Column j of the regressor is the motion by joint j, times the load of that joint."""
    data = visited(poses=3)
    A = data.regressor(MODEL)
    motion = joint_motion(MODEL, data)[..., MODEL.joints]
    torque = np.einsum("mrp,mrp->mp", A, motion) / np.einsum("mrp,mrp->mp", motion, motion)
    np.testing.assert_allclose(A, motion * torque[:, None], rtol=1e-9, atol=1e-12 * np.abs(A).max())
