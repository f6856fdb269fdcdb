"""Joints that count as rigid: how much each would matter, and the sentence about them."""

import numpy as np
import pytest
from chains import mixed_chain

from edtk.measure.elastostatic_model import ElastostaticModel
from edtk.measure.task import rigid_joints, rigid_joints_in_words
from edtk.robots.load_robot import load_robot

ROBOT = load_robot("kuka_kr270")
Q = np.deg2rad([[10.0, -60, 80, 30, 40, 50], [0.0, -90, 90, 0, 90, 0]])
WRENCH = np.tile([0.0, 0, -1000, 0, 0, 0], (2, 1))


def test_displacements_are_those_of_the_linear_model():
    """Displacements are lengths of ``J_j tau_j`` by 1e-7 rad/(N m), in the worst pose."""
    J = ROBOT.jacobian(Q)
    found = rigid_joints(ElastostaticModel(ROBOT), Q, WRENCH, ("q3",))
    assert "q2" in {joint.name for joint in found}
    assert "q3" not in {joint.name for joint in found}
    for joint in found:
        j = ROBOT.joint_names.index(joint.name)
        each = [1e-7 * np.linalg.norm(Ji[:3, j]) * abs(Ji[:, j] @ WRENCH[0]) for Ji in J]
        assert joint.displacement == pytest.approx(max(each), rel=1e-12)


def test_a_prismatic_joint_is_not_reported():
    """Joints count as rigid if they turn and no compliance of theirs is known."""
    robot = mixed_chain(5)
    q = np.random.default_rng(2).uniform(-1, 1, size=(1, robot.n))
    wrench = np.array([[300.0, -200.0, 500.0, 10.0, -20.0, 30.0]])
    kinds = {joint.name: joint.kind for joint in robot.joints}
    assert kinds["q2"] == "prismatic"
    found = rigid_joints(ElastostaticModel(robot), q, wrench, ("q1", "q3"))
    assert [joint.name for joint in found] == ["q4"]


def test_words():
    """The sentence names each joint with its displacement in mm; nothing is said of none."""
    found = rigid_joints(ElastostaticModel(ROBOT), Q, WRENCH, ("q1", "q3", "q4", "q5", "q6"))
    text = rigid_joints_in_words(found)
    assert f"rigid: q2 ({1e3 * found[0].displacement:.2g} mm); under the task" in text
    assert "each 1e-07 rad/(N m)" in text
    assert rigid_joints_in_words(()) == ""
